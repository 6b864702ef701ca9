"""A sensor's packets over loopback: the sweeps of their capture, and a service that tracks them."""

from __future__ import annotations

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from modt.schemes import open_sensor
from modt.sources.recognise import open_stream

from .commands import ROOT, content, environment
from .test_run import Service

pytestmark = [pytest.mark.command, pytest.mark.slow]


def send(port: int, *arguments: object) -> None:
    """Run `tools.send.packets` to its end."""
    command = [sys.executable, "-m", "tools.send.packets", f"127.0.0.1:{port}", *map(str, arguments)]
    env = environment() | {"PYTHONPATH": f"{ROOT}:{environment()['PYTHONPATH']}"}
    done = subprocess.run(command, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def simulated(port: int, scheme: str, model: str, folder: Path) -> Path:
    """A capture of eight turns of an ideal sensor."""
    if scheme == "velodyne":
        pytest.importorskip("velodyne_decoder", reason="needs the extra [velodyne]")
    send(port, "--as", model, "--frames", "0:8", "--once", "--write", folder / "drive.pcap")
    return folder / "drive.pcap"


def assert_live_is_as_recorded(address: str, port: int, capture: Path, least: int) -> None:
    """Send a capture to the sensor's address; a busy machine may leave sweeps out, which are counted."""
    expected = [frame.points.tobytes() for frame in open_stream(capture)]
    live = open_sensor(address)
    taken = list[bytes]()
    live.start()
    with ThreadPoolExecutor(1) as sending:
        sent = sending.submit(send, port, capture, "--once")
        while (received := live.take(1.0)) or not sent.done():
            taken += [received.frame.points.tobytes()] if received else []
    live.close()
    sent.result()
    assert taken
    assert len(taken) + live.dropped + live.faults.skipped >= least
    places = [expected.index(points) for points in taken]
    assert places == sorted(set(places))


@pytest.mark.parametrize(("scheme", "model"), [("hesai", "xt-32"), ("livox", "mid-360"), ("velodyne", "vlp-16")])
def test_a_simulated_sensor_over_loopback_gives_the_sweeps_of_its_capture(scheme, model, port, tmp_path):
    capture = simulated(port, scheme, model, tmp_path)
    assert_live_is_as_recorded(f"{scheme}://127.0.0.1:{port}", port, capture, least=6)


def test_a_service_tracks_what_the_packets_show(port, tmp_path):
    capture = simulated(port, "livox", "mid-360", tmp_path)
    service = Service(tmp_path, f"livox://127.0.0.1:{port}", "--core", "none", watchdog_s=60.0)
    try:
        service.hear("READY=1")
        send(port, capture, "--once")
        status, said = service.end()
    finally:
        service.close()
    assert status == 0, said
    written = content(service.out / "status.json")
    assert (written["profile"], written["sensor"]["refused_messages"]) == ("mid-360", {})
    assert written["sensor"]["sweeps"] >= 6
    assert written["counts"]["tracks"] > 5
