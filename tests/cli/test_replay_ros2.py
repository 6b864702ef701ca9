"""`modt replay` of a recording of ROS 2, and with the poses of a topic."""

from __future__ import annotations

import numpy as np
import pytest

from modt.app.inputs import Request
from modt.app.session import replay
from modt.app.supervisor import Supervisor
from modt.ros2 import odometry
from modt.ros2.odometry import write_odometry
from modt.ros2.point_cloud2 import write_cloud
from modt.sinks.records import read_records
from modt.sinks.tracks import SCHEMA
from modt_desk.simulation.synthetic_stream import SyntheticStream
from tests.ros2 import messages
from tests.ros2.network import FAR, NEAR, until
from tests.sources.bags import BEGAN_S, CLOUD, ODOMETRY, write_mcap, write_rosbag2

from .commands import modt

pytestmark = pytest.mark.command

FRAMES = 5


@pytest.fixture(scope="module", name="street")
def the_embedded_street():
    return list(SyntheticStream("street", "hdl-64e", 10.0, seed=0).between(0, FRAMES))


def session(out, **options):
    return replay(Request(mode="efficient", frames=(0, FRAMES), **options), {}, out, None, ["modt"])


def run(out, **options):
    made = session(out, **options)
    return made, made.run(Supervisor())


def tracks(out):
    """Id and box of each track of each frame."""
    frames = read_records(out / "tracks.jsonl", SCHEMA)
    return [[(t["id"], *(t["box"] or {}).values()) for t in frame["tracks"]] for frame in frames]


def assert_alike(one, other):
    """The same tracks, with boxes that differ by what the rounding of stamps and poses does."""
    for a, b in zip(tracks(one), tracks(other), strict=True):
        assert [row[0] for row in a] == [row[0] for row in b]
        np.testing.assert_allclose(sum((row[1:] for row in a), ()), sum((row[1:] for row in b), ()), atol=0.002)


def test_a_recording_gives_the_tracks_of_what_was_recorded(street, tmp_path):
    recorded = []
    for frame in street:
        s = BEGAN_S + frame.stamp_s
        recorded.append(("/odom", ODOMETRY, s, write_odometry(s, "odom", "lidar", frame.T_world_sensor)))
        recorded.append(("/points", CLOUD, s, write_cloud(s, "lidar", frame.points)))
    made, _ = run(tmp_path / "bag", path=write_mcap(tmp_path / "drive", recorded), profile="hdl-64e")
    assert made.stages.info.layout == "rosbag2"
    run(tmp_path / "street", profile="hdl-64e")
    assert_alike(tmp_path / "bag", tmp_path / "street")


XYZ = [("x", "f4"), ("y", "f4"), ("z", "f4")]
LAYOUTS = {
    "common": [*XYZ, ("intensity", "f4")],
    "ring and time": [*XYZ, ("intensity", "f4"), ("ring", "u2"), ("time", "f4")],
    "padded": {
        "names": ["x", "y", "z", "intensity"],
        "formats": ["f4"] * 4,
        "offsets": [0, 4, 8, 16],
        "itemsize": 32,
    },
    "whole numbers": [*XYZ, ("intensity", "u2")],
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_recording_by_others_gives_the_tracks_of_the_scans(street, layout, tmp_path):
    recorded = []
    for frame in street:
        points = np.zeros((1, len(frame.points)), LAYOUTS[layout])
        for k, name in enumerate(("x", "y", "z", "intensity")):
            scale = 65535 if points[name].dtype.kind == "u" else 1
            points[name] = (frame.points[:, k] * scale).round(0 if scale > 1 else 9)
        stamp_s = BEGAN_S + frame.stamp_s
        recorded.append(("/points", CLOUD, stamp_s, messages.encode(messages.cloud(points, stamp_s=stamp_s))))
    path = write_rosbag2(tmp_path / "drive", recorded)
    run(tmp_path / "bag", path=path, profile="hdl-64e", odometry="none")
    (tmp_path / "scans").mkdir()
    for frame in street:
        frame.points.tofile(tmp_path / "scans" / f"{BEGAN_S + frame.stamp_s:.6f}.bin")
    run(tmp_path / "plain", path=tmp_path / "scans", profile="hdl-64e", odometry="none")
    assert_alike(tmp_path / "bag", tmp_path / "plain")


def test_the_poses_of_a_topic_place_the_sweeps(street, tmp_path, loopback):
    from modt.ros2 import dds

    made = session(tmp_path / "run", odometry=f"ros2:///odom?domain={NEAR}")
    sent = dds.Publication(dds.participant(FAR), "odom", odometry.TYPE)
    until(lambda: sent.receivers and made.stages.odometry._subscription.senders)
    for frame in street:
        sent.write(write_odometry(frame.stamp_s, "odom", "lidar", frame.T_world_sensor))
    until(lambda: made.stages.odometry.place(street[0]).T_world_sensor is not None)
    summary = made.run(Supervisor())
    assert summary["odometry"]["frames_unposed"] <= FRAMES
    assert summary["odometry"]["frames_posed"] >= FRAMES
    assert summary["odometry"]["used"] == FRAMES


def test_topics_are_named_on_the_command_line(tmp_path):
    recorded = [(f"/{k}", CLOUD, BEGAN_S, write_cloud(BEGAN_S, "lidar", np.ones((9, 4), np.float32))) for k in "ab"]
    path = write_mcap(tmp_path / "drive", recorded)
    refused = modt("replay", path, "--quiet", cwd=tmp_path)
    assert (refused.returncode, "choose by --capture topic=NAME: /a, /b" in refused.stderr) == (2, True)
    assert modt("replay", path, "--capture", "topic=/b", "--quiet", "--out", "run", cwd=tmp_path).returncode == 0
