"""`modt replay` of packets, and of recordings of ROS 2."""

import numpy as np
import pytest

from modt.app.systemd import Notifier
from modt.ros2.odometry import write_odometry
from modt.ros2.point_cloud2 import write_cloud
from modt.sinks.tracks import SCHEMA
from modt_profiling.reporting.records import read_records
from modt_simulation.synthetic_stream import SyntheticStream
from tests.sources.bags import BEGAN_S, CLOUD, ODOMETRY, write_mcap
from tests.sources.packets.simulated import packets
from tools.send.pcap_writer import write_capture

from .commands import content, refusal, session, succeeded

pytestmark = pytest.mark.command

pytest.importorskip("velodyne_decoder", reason="needs the extra [velodyne]")


@pytest.fixture
def capture(tmp_path):
    write_capture(tmp_path / "drive.pcap", packets(), 2368)
    return tmp_path / "drive.pcap"


@pytest.mark.parametrize(("options", "frames"), [(("--capture", "model=vlp-16"), 3), (("--frames", "50:"), 0)])
def test_a_capture_is_replayed(tmp_path, capture, options, frames):
    done = succeeded("replay", capture, *options, "--out", "run", cwd=tmp_path)
    summary = content(tmp_path / "run/summary.json")
    assert (summary["frames"], summary["faults"]["count"]) == (frames, 0)
    assert summary["run"]["stream"] == "drive"
    assert "leaked" not in done.stderr, "the decoder's library leaks"


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (
            ["--capture", "colour=red"],
            "colour does not apply; --capture takes calibration, host, metadata, model, port here",
        ),
        (["--capture", "model"], "write KEY=VALUE"),
        (["--capture", "model=vlp-17"], "use one of vlp-16"),
        (["--capture", "calibration=nowhere.yaml"], "no calibration"),
        (["--capture", "metadata=nowhere.json"], "nowhere.json: cannot be read"),
    ],
)
def test_invalid_options_are_misuse(capsys, capture, arguments, named):
    if "metadata" in arguments[1]:
        pytest.importorskip("ouster.sdk.core", reason="needs the extra [ouster]")
    assert named in refusal(capsys, "replay", capture, *arguments)


def test_a_recording_of_sweeps_and_poses_gives_the_tracks_of_what_was_recorded(tmp_path):
    """Boxes differ by the rounding of stamps and poses."""
    recorded = []
    for frame in SyntheticStream("street", "hdl-64e", 10.0, seed=0).between(0, 5):
        s = BEGAN_S + frame.stamp_s
        recorded.append(("/odom", ODOMETRY, s, write_odometry(s, "odom", "lidar", frame.T_world_sensor)))
        recorded.append(("/points", CLOUD, s, write_cloud(s, "lidar", frame.points)))
    found = []
    for out, path in ((tmp_path / "bag", write_mcap(tmp_path / "drive", recorded)), (tmp_path / "own", None)):
        session(out, 5, path=path, profile="hdl-64e").run(Notifier())
        frames = read_records(out / "tracks.jsonl", SCHEMA)
        found.append([(t["id"], *(t["box"] or {}).values()) for frame in frames for t in frame["tracks"]])
    assert [row[0] for row in found[0]] == [row[0] for row in found[1]]
    np.testing.assert_allclose(*(sum((row[1:] for row in rows), ()) for rows in found), atol=0.002)
