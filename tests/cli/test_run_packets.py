"""A sensor's packets over loopback by two commands, `tools.send.packets` and `modt run`: the tracks of the file."""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from modt.sinks.tracks import SCHEMA
from modt_desk.reporting.records import read_records

from .commands import environment, modt
from .test_run import Service

pytestmark = pytest.mark.command

SHOTS = 6
"""Greatest number of runs: on a busy machine a run leaves sweeps out, and late stamps decide a tie the other way."""
MOST_JITTER_S = 3e-5
"""Greatest difference of the stamps [s]; those of a run follow the arrival of the packets."""
MEASURED = {"xt-32": ("xt32-1673400677802009732", "PandarXT32"), "pandar64": ("64-1673403880599376836", "Pandar64")}
"""Recorded packets, and the angles of their sensor."""


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def send(*arguments: object, cwd: Path) -> None:
    """Run the sender to its end."""
    root = Path(__file__).resolve().parents[2]
    command = [sys.executable, "-m", "tools.send.packets", *map(str, arguments)]
    path = f"{root}:{environment()['PYTHONPATH']}"
    done = subprocess.run(
        command, env={**environment(), "PYTHONPATH": path}, cwd=cwd, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def frames_of(run: Path) -> list[dict[str, Any]]:
    return list(read_records(run / "tracks.jsonl", SCHEMA))


def exact(frame: dict[str, Any]) -> list[object]:
    """Everything but the filter's state and the posterior, for the live stamps differ by microseconds."""
    names = "id", "class", "final", "viewed", "proposal", "points", "age", "missed", "box"
    return [frame["proposals"], frame["classified"], [[track[name] for name in names] for track in frame["tracks"]]]


def posteriors(frames: list[dict[str, Any]]) -> list[float]:
    return [p for frame in frames for track in frame["tracks"] for p in track["posterior"]]


def undisturbed(live: list[dict[str, Any]], file: list[dict[str, Any]]) -> bool:
    """Whether every sweep was taken in time; the last one of a file does not wait for the packet after it."""
    if len(live) < len(file) - 1:
        return False
    pairs = list(zip(live, file, strict=False))
    late_s = [(a["stamp_s"] - live[0]["stamp_s"]) - (b["stamp_s"] - file[0]["stamp_s"]) for a, b in pairs]
    return all(a["deferred"] == b["deferred"] for a, b in pairs) and max(map(abs, late_s)) < MOST_JITTER_S


def assert_live_is_as_replayed(address: str, port: int, capture: Path, options: tuple[str, ...], least: int) -> None:
    """Replay a capture, and run it live until a run that took every sweep is as the replay."""
    folder = capture.parent
    done = modt("replay", capture, *options, "--out", folder / "file", "--quiet", cwd=folder)
    assert done.returncode == 0, done.stderr
    file = frames_of(folder / "file")
    assert len(file) >= least
    nearest: tuple[object, object] | None = None
    for shot in range(SHOTS):
        (folder / f"shot-{shot}").mkdir()
        service = Service(folder / f"shot-{shot}", address, *options, "--core", "none", watchdog_s=60.0)
        try:
            service.hear("READY=1")
            send(f"127.0.0.1:{port}", capture, "--once", cwd=folder)
            time.sleep(0.5)
            status, said = service.end()
        finally:
            service.close()
        assert status == 0, said
        live = frames_of(service.out)
        if undisturbed(live, file):
            taken = file[: len(live)]
            nearest = [exact(frame) for frame in live], [exact(frame) for frame in taken]
            if nearest[0] == nearest[1]:
                assert posteriors(live) == pytest.approx(posteriors(taken), abs=0.01)
                return
    if nearest is None:
        pytest.skip(f"this machine was too busy for each of {SHOTS} runs")
    assert nearest[0] == nearest[1]


@pytest.mark.slow
@pytest.mark.parametrize(("scheme", "model"), [("hesai", "xt-32"), ("livox", "mid-360"), ("velodyne", "vlp-16")])
def test_a_simulated_sensor_over_loopback_gives_the_tracks_of_its_capture(scheme, model, tmp_path):
    if scheme == "velodyne":
        pytest.importorskip("velodyne_decoder", reason="needs the extra [velodyne]")
    port, capture = free_port(), tmp_path / "drive.pcap"
    send(f"127.0.0.1:{port}", "--as", model, "--frames", "0:8", "--once", "--write", capture, cwd=tmp_path)
    address = f"{scheme}://127.0.0.1:{port}"
    assert_live_is_as_replayed(address, port, capture, ("--profile", model), least=6)


@pytest.mark.slow
@pytest.mark.kitti
@pytest.mark.parametrize("profile", MEASURED)
def test_a_recorded_hesai_over_loopback_gives_the_tracks_of_its_capture(profile, kitti_root, tmp_path):
    name, table = MEASURED[profile]
    port, capture = free_port(), tmp_path / "drive.pcap"
    angles = kitti_root / "packets" / "calibration" / f"{table}.csv"
    capture.with_suffix(".csv").write_bytes(angles.read_bytes())
    send(f"127.0.0.1:{port}", kitti_root / "packets" / name, "--write", capture, cwd=tmp_path)
    address = f"hesai://127.0.0.1:{port}?calibration={angles}"
    assert_live_is_as_replayed(address, port, capture, ("--profile", profile), least=3)
