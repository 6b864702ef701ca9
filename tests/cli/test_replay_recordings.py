"""`modt replay` of recordings of ROS 2 gives the tracks of what was recorded."""

import numpy as np
import pytest

from modt.app.supervisor import Supervisor
from modt.ros2.odometry import write_odometry
from modt.ros2.point_cloud2 import write_cloud
from modt.sinks.tracks import SCHEMA
from modt_desk.reporting.records import read_records
from modt_desk.simulation.synthetic_stream import SyntheticStream
from tests.ros2 import messages
from tests.sources.bags import BEGAN_S, CLOUD, ODOMETRY, write_mcap, write_rosbag2

from .commands import session

pytestmark = pytest.mark.command

FRAMES = 5
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


@pytest.fixture(scope="module", name="street")
def the_embedded_street():
    return list(SyntheticStream("street", "hdl-64e", 10.0, seed=0).between(0, FRAMES))


def tracks(out, **options):
    """Id and box of each track of each frame."""
    session(out, FRAMES, **options).run(Supervisor())
    frames = read_records(out / "tracks.jsonl", SCHEMA)
    return [[(t["id"], *(t["box"] or {}).values()) for t in frame["tracks"]] for frame in frames]


def assert_alike(one, other):
    """The same tracks, with boxes that differ by what the rounding of stamps and poses does."""
    for a, b in zip(one, other, strict=True):
        assert [row[0] for row in a] == [row[0] for row in b]
        np.testing.assert_allclose(sum((row[1:] for row in a), ()), sum((row[1:] for row in b), ()), atol=0.002)


def test_of_sweeps_and_poses(street, tmp_path):
    recorded = []
    for frame in street:
        s = BEGAN_S + frame.stamp_s
        recorded.append(("/odom", ODOMETRY, s, write_odometry(s, "odom", "lidar", frame.T_world_sensor)))
        recorded.append(("/points", CLOUD, s, write_cloud(s, "lidar", frame.points)))
    path = write_mcap(tmp_path / "drive", recorded)
    assert_alike(tracks(tmp_path / "bag", path=path, profile="hdl-64e"), tracks(tmp_path / "own", profile="hdl-64e"))


@pytest.fixture(scope="module", name="of_scans")
def tracks_of_the_scans(street, tmp_path_factory):
    folder = tmp_path_factory.mktemp("scans")
    for frame in street:
        frame.points.tofile(folder / f"{BEGAN_S + frame.stamp_s:.6f}.bin")
    return tracks(folder / "run", path=folder, profile="hdl-64e", odometry="none")


@pytest.mark.parametrize("layout", LAYOUTS)
def test_of_clouds_that_others_wrote(street, of_scans, layout, tmp_path):
    recorded = []
    for frame in street:
        points = np.zeros((1, len(frame.points)), LAYOUTS[layout])
        for k, name in enumerate(("x", "y", "z", "intensity")):
            scale = 65535 if points[name].dtype.kind == "u" else 1
            points[name] = (frame.points[:, k] * scale).round(0 if scale > 1 else 9)
        stamp_s = BEGAN_S + frame.stamp_s
        recorded.append(("/points", CLOUD, stamp_s, messages.encode(messages.cloud(points, stamp_s=stamp_s))))
    path = write_rosbag2(tmp_path / "drive", recorded)
    assert_alike(tracks(tmp_path / "bag", path=path, profile="hdl-64e", odometry="none"), of_scans)
