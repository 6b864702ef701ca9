"""`modt replay` of packets and point clouds."""

import json

import pytest

from tests.sources.packets.simulated import packets
from tools.send.pcap_writer import write_capture

from .commands import modt

pytestmark = pytest.mark.command

pytest.importorskip("velodyne_decoder", reason="needs the extra [velodyne]")


@pytest.fixture
def capture(tmp_path):
    write_capture(tmp_path / "drive.pcap", packets(), 2368)
    return tmp_path / "drive.pcap"


def test_a_capture_is_replayed(tmp_path, capture):
    done = modt("replay", capture, "--capture", "model=vlp-16", "--out", "run", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert (summary["frames"], summary["faults"]["count"]) == (3, 0)
    assert summary["run"]["stream"] == "drive"
    assert "leaked" not in done.stderr  # of the decoder's library


def test_a_part_without_frames_is_an_empty_run(tmp_path, capture):
    done = modt("replay", capture, "--frames", "50:", "--out", "run", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["frames"] == 0


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--capture", "colour=red"], "KEY one of model, calibration, metadata"),
        (["--capture", "model"], "write KEY=VALUE"),
        (["--capture", "model=vlp-17"], "use one of vlp-16"),
        (["--capture", "metadata=nowhere.json"], "nowhere.json: cannot be read"),
    ],
)
def test_invalid_options_are_misuse(tmp_path, capture, arguments, said):
    if "metadata" in arguments[1]:
        pytest.importorskip("ouster.sdk.core", reason="needs the extra [ouster]")
    done = modt("replay", capture, *arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert said in done.stderr
