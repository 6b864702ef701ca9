"""Contract of every source."""

import itertools

import numpy as np
import pytest

from modt.sources.recognise import open_stream
from modt_simulation.synthetic_stream import SyntheticStream
from tests.sources import bags, layouts
from tests.sources.packets.simulated import packets
from tests.sources.point_clouds import pcd
from tools.send.pcap_writer import write_capture


def clouds(root):
    for frame in range(3):
        rows = np.rec.fromarrays(layouts.scan(frame).T, names="x,y,z,intensity")
        (root / f"{frame}.pcd").write_bytes(pcd(rows))
    return open_stream(root)


def capture(root):
    pytest.importorskip("velodyne_decoder", reason="needs the extra [velodyne]")
    write_capture(root / "drive.pcap", packets(), 2368)
    return open_stream(root / "drive.pcap")


SOURCES = {
    "raw": lambda root: open_stream(layouts.raw_drive(root)),
    "tracking": lambda root: open_stream(layouts.tracking(root)),
    "odometry": lambda root: open_stream(layouts.odometry(root)),
    "bare": lambda root: open_stream(layouts.bare(root)),
    "bag": lambda root: open_stream(bags.write_rosbag2(root / "bag", bags.by_time(bags.clouds(), bags.poses()))),
    "clouds": clouds,
    "capture": capture,
    "simulated": lambda root: SyntheticStream("street", "vlp-16", 0.4, seed=3),
}


@pytest.fixture(params=SOURCES, name="stream")
def a_stream(request, tmp_path):
    return SOURCES[request.param](tmp_path)


def test_frames_have_valid_points_and_poses_and_increasing_stamps(stream):
    frames = list(stream)
    assert stream.info.n_frames in (len(frames), None)
    for frame in frames:
        assert frame.points.dtype == np.float32
        assert frame.points.ndim == 2
        assert frame.points.shape[1] == 4
        assert np.isfinite(frame.points).all()
        assert frame.points[:, 3].min() >= 0
        assert frame.points[:, 3].max() <= 1
        assert (frame.T_world_sensor is not None) is stream.info.has_poses
        if frame.T_world_sensor is not None:
            R = frame.T_world_sensor[:3, :3]
            np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-6)
    assert all(b.stamp_s >= a.stamp_s and b.index > a.index for a, b in itertools.pairwise(frames))
    assert stream.faults.count == 0


def test_a_stream_can_be_iterated_again(stream):
    for a, b in zip(stream, stream, strict=True):
        assert (a.index, a.stamp_s) == (b.index, b.stamp_s)
        assert a.points.tobytes() == b.points.tobytes()


def test_a_part_of_a_stream_has_its_frames(stream):
    whole = {f.index: f for f in stream}
    part = stream.between(1, 3)
    assert part.info.n_frames in (2, None)
    for frame in part:
        assert frame.points.tobytes() == whole[frame.index].points.tobytes()
    assert [f.index for f in part] == [1, 2]
    assert stream.info.n_frames in (len(whole), None)  # the whole is not changed by it
    assert [f.index for f in part.between(2, None)] == [2]
    assert list(stream.between(50, None)) == []
    assert part.between(50, None).info.n_frames == 0
