"""`modt replay` of packets and point clouds."""

import json

import pytest

from tests.sources.packets.simulated import packets
from tools.send.pcap_writer import write_capture

from .commands import modt, refusal

pytestmark = pytest.mark.command

pytest.importorskip("velodyne_decoder", reason="needs the extra [velodyne]")


@pytest.fixture
def capture(tmp_path):
    write_capture(tmp_path / "drive.pcap", packets(), 2368)
    return tmp_path / "drive.pcap"


@pytest.mark.parametrize(("options", "frames"), [(("--capture", "model=vlp-16"), 3), (("--frames", "50:"), 0)])
def test_a_capture_is_replayed(tmp_path, capture, options, frames):
    done = modt("replay", capture, *options, "--out", "run", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert (summary["frames"], summary["faults"]["count"]) == (frames, 0)
    assert summary["run"]["stream"] == "drive"
    assert "leaked" not in done.stderr, "the decoder's library leaks"


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["--capture", "colour=red"], "KEY one of model, calibration, metadata"),
        (["--capture", "model"], "write KEY=VALUE"),
        (["--capture", "model=vlp-17"], "use one of vlp-16"),
        (["--capture", "metadata=nowhere.json"], "nowhere.json: cannot be read"),
    ],
)
def test_invalid_options_are_misuse(capsys, capture, arguments, named):
    if "metadata" in arguments[1]:
        pytest.importorskip("ouster.sdk.core", reason="needs the extra [ouster]")
    assert named in refusal(capsys, "replay", capture, *arguments)
