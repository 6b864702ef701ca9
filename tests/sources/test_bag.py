"""Recordings of ROS 2, in both kinds of files."""

import gc
import sqlite3
import tempfile
import threading
from contextlib import closing, nullcontext

import numpy as np
import pytest
import zstandard
from numpy.testing import assert_allclose, assert_array_equal

from modt.errors import MisuseError, ModtError
from modt.sources.recognise import open_stream
from tests.ros2 import messages
from tests.sources import layouts
from tests.sources.bags import BEGAN_S, TF, UP, by_time, clouds, poses, sweep, write_mcap, write_rosbag2


@pytest.fixture(params=[write_rosbag2, write_mcap])
def write(request):
    return request.param


@pytest.fixture
def opened(write, tmp_path):
    return lambda recorded: open_stream(write(tmp_path / "drive", recorded))


def x_of(frames):
    return [frame.T_world_sensor[0, 3] for frame in frames]


def stamps_of(frames):
    return [frame.stamp_s for frame in frames]


def tenths(n, first=0):
    """Numbers a tenth apart, of some stamps or of the way of the robot."""
    return pytest.approx(first + np.arange(n) / 10, abs=1e-6)


def test_sweeps_are_frames_and_stamps_count_from_the_first(opened):
    stream = opened(by_time(clouds(), poses()))
    assert (stream.info.name, stream.info.layout, stream.info.n_frames) == ("drive", "rosbag2", 4)
    assert stream.info.period_s == pytest.approx(0.1, abs=1e-6)
    frames = list(stream)
    assert [frame.index for frame in frames] == [0, 1, 2, 3]
    assert stamps_of(frames) == tenths(4)
    for k, frame in enumerate(frames):
        expected = messages.xyzi(20 + k).view(np.float32).reshape(-1, 4)
        assert_array_equal(frame.points, expected)
    assert stream.info.has_poses  # interpolated at the stamps of the sweeps
    assert x_of(frames) == tenths(4, 10)


def test_the_mount_of_the_sensor_is_taken_from_the_static_transforms(opened):
    turned = [0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]
    mount = messages.encode(messages.transforms(("base_link", "lidar", [1.0, 0.0, 2.0], turned)))
    recorded = by_time(clouds(), poses("base_link"), [("/tf_static", TF, BEGAN_S - 1, mount)])
    first = next(iter(opened(recorded)))
    assert_allclose(first.T_world_sensor[:3, 3], [11.0, 0.0, 2.0], atol=1e-6)
    assert_allclose(first.T_world_sensor[:3, 0], [0.0, 1.0, 0.0], atol=1e-6)


@pytest.mark.parametrize(
    ("others", "note"),
    [
        ([], "no nav_msgs/Odometry: no poses"),
        (poses("base_link"), "/tf_static does not lead from base_link, their frame, to lidar"),
        (by_time(poses(), poses(topic="/wheels")), "several topics of odometry (/odom, /wheels)"),
    ],
)
def test_poses_that_cannot_be_used_are_left_out_and_named(opened, others, note):
    stream = opened(by_time(clouds(), others))
    assert not stream.info.has_poses
    assert note in " ".join(stream.info.pose_notes)
    assert [frame.T_world_sensor for frame in stream] == [None] * 4


@pytest.mark.parametrize(("stated", "read"), [("", True), ("json", False)])
def test_a_database_that_states_no_encoding_holds_cdr(stated, read, tmp_path):
    path = write_rosbag2(tmp_path / "drive", clouds(2))
    with closing(sqlite3.connect(next(path.glob("*.db3")))) as database, database:
        database.execute("UPDATE topics SET serialization_format = ?", (stated,))
    with nullcontext() if read else pytest.raises(MisuseError, match="no sensor_msgs/PointCloud2"):
        assert open_stream(path).info.n_frames == 2


def test_one_of_several_topics_is_to_be_chosen_and_what_is_there_is_named(write, tmp_path):
    path = write(tmp_path / "drive", by_time(clouds(), clouds(2, "/rear/points")))
    with pytest.raises(MisuseError, match=r"choose by --capture topic=NAME: /points, /rear/points"):
        open_stream(path)
    assert open_stream(path, capture={"topic": "rear/points"}).info.n_frames == 2
    with pytest.raises(MisuseError, match=r"no point clouds in /front"):
        open_stream(path, capture={"topic": "/front"})
    with pytest.raises(MisuseError, match=r"no sensor_msgs/PointCloud2; .* it holds nav_msgs/Odometry"):
        open_stream(write(tmp_path / "poses", poses()))


def test_a_message_that_cannot_be_used_is_counted_and_skipped(opened, caplog):
    recorded = clouds()
    recorded[1] = (*recorded[1][:3], b"\0\1\0\0\1\2")
    recorded[2] = (*recorded[2][:3], recorded[0][3])  # stamped as the first one
    recorded[3] = sweep(recorded[3][2], stamp_s=BEGAN_S - 5)
    stream = opened(recorded)
    assert [frame.index for frame in stream] == [0, 2]
    assert stream.faults.skipped == 2
    assert "/points: frame 1: 6 bytes end within a field; frame skipped" in caplog.text
    assert "/points: frame 3: stamped 5.000 s before the last sweep; frame skipped" in caplog.text


def test_a_driver_without_stamps_is_stamped_by_the_recording(opened):
    stream = opened([sweep(BEGAN_S + k / 10, stamp_s=0.0) for k in range(3)])
    assert stamps_of(stream) == tenths(3)


@pytest.mark.parametrize("unit_s", [0.0, 1e-3, 1e3])
def test_stamps_that_stand_still_are_replaced_by_the_times_of_the_recording(opened, unit_s):
    stream = opened([sweep(BEGAN_S + k / 10, stamp_s=1000.0 + k / 10 * unit_s) for k in range(6)])
    assert stamps_of(stream) == tenths(6)
    assert "the stamps of the sweeps stand still" in stream.info.notes[0]


def test_a_sweep_that_is_recorded_twice_is_read_once(opened):
    twice = by_time(clouds(6), [(topic, kind, s + 1e-3, data) for topic, kind, s, data in clouds(6)])
    stream = opened(twice)
    assert stamps_of(stream) == tenths(6)
    assert stream.faults.left_out == {"has the stamp of the last sweep: recorded twice?": 6}


@pytest.mark.parametrize("asked", [None, "rear"])
def test_one_of_two_sensors_in_a_topic_is_read_and_the_other_counted(write, tmp_path, asked):
    times_s = [BEGAN_S + k / 20 for k in range(12)]
    recorded = [sweep(s, stamp_s=s, frame_id=("front", "rear")[k % 2]) for k, s in enumerate(times_s)]
    path = write(tmp_path / "drive", recorded)
    stream = open_stream(path, capture={} if asked is None else {"frame": asked})
    frames = list(stream)
    assert stamps_of(frames) == tenths(6)
    assert stream.reading.frame_id == (asked or "front")
    other = "front" if asked else "rear"
    assert stream.faults.left_out == {f"messages are of another sensor, in the frame {other}": 6}
    assert "several sensors share the topic" in stream.info.notes[0]
    with pytest.raises(MisuseError, match=r"frames of points: front, rear"):
        open_stream(path, capture={"frame": "left"})


@pytest.mark.parametrize(("frame_id", "note"), [("camera_init", "record what"), ("eye_optical_frame", "of a camera")])
def test_points_that_are_not_in_the_axes_of_a_sensor_are_noted(opened, frame_id, note):
    stream = opened([sweep(BEGAN_S + k, stamp_s=BEGAN_S + k, frame_id=frame_id) for k in (0, 1)])
    assert note in stream.info.notes[0]


@pytest.mark.parametrize("lying", [lambda k, s: s + 3600 * (k == 3), lambda k, s: s + 3600 * (k == 0)])
def test_a_lying_stamp_of_a_pose_costs_no_other_pose(opened, lying):
    recorded = []
    for k, (topic, kind, recorded_s, _) in enumerate(poses()):
        true_s = recorded_s - 0.001
        message = messages.odometry(lying(k, true_s), [10.0 + true_s - BEGAN_S, 0.0, 0.0], UP, "lidar")
        recorded.append((topic, kind, recorded_s, messages.encode(message)))
    frames = list(opened(by_time(clouds(), recorded)))
    assert x_of(frames) == tenths(4, 10)


def test_poses_that_a_localisation_gives_seconds_later_are_those_of_their_stamps(opened):
    late = [(topic, kind, recorded_s + 1.5, data) for topic, kind, recorded_s, data in poses()]
    stream = opened(by_time(clouds(), late))
    assert x_of(stream) == tenths(4, 10)
    assert stream.reading.without_pose == 0


def test_frames_without_a_pose_are_counted(opened):
    stream = opened(by_time(clouds(12), poses()[:20]))
    frames = list(stream)
    assert [frame.T_world_sensor is None for frame in frames] == [False] * 5 + [True] * 7
    assert stream.reading.without_pose == 7


@pytest.mark.parametrize("back_s", [0.5, 3600.0])
@pytest.mark.parametrize("options", [None, {}, {"chunk_size": 1500}, {"use_chunking": False}])
def test_what_is_recorded_after_the_clock_was_set_back_comes_later(tmp_path, options, back_s):
    recorded = by_time(clouds(12), poses(), poses(topic="/wheels"))
    recorded = [(*m[:2], m[2] - back_s * (k >= len(recorded) // 2), m[3]) for k, m in enumerate(recorded)]
    path = tmp_path / "drive"
    path = write_rosbag2(path, recorded) if options is None else write_mcap(path, recorded, **options)
    stream = open_stream(path, capture={"odometry": "odom"})
    assert stamps_of(stream) == tenths(12)
    assert not stream.faults.count


def test_topics_that_a_converter_wrote_one_after_the_other_are_merged(opened):
    stream = opened([*clouds(), *poses()])
    assert x_of(stream) == tenths(4, 10)


def test_a_wrong_stamp_of_the_first_sweep_costs_it_alone(opened):
    late = sweep(clouds()[0][2], stamp_s=BEGAN_S + 3600)
    frames = list(opened(by_time([late], clouds()[1:], poses())))
    assert [frame.index for frame in frames] == [1, 2, 3]
    assert x_of(frames) == tenths(3, 10.1)


def test_the_cause_of_unusable_clouds_is_named(write, tmp_path):
    rows = np.zeros((1, 5), [("x", "i2"), ("y", "i2"), ("z", "i2"), ("intensity", "u1")])
    path = write(tmp_path / "drive", [sweep(BEGAN_S + k / 10, rows, stamp_s=BEGAN_S) for k in range(3)])
    with pytest.raises(ModtError, match=r"x \(int16\), y \(int16\), z \(int16\).*float32"):
        open_stream(path)


@pytest.mark.parametrize("chunk_size", [1, 10**6])
def test_messages_of_an_mcap_file_come_in_the_order_of_their_recording(tmp_path, chunk_size):
    recorded = clouds(6)
    path = write_mcap(tmp_path / "drive", [recorded[k] for k in (1, 0, 4, 2, 3, 5)], chunk_size=chunk_size)
    assert [len(frame.points) for frame in open_stream(path)] == list(range(20, 26))


def test_a_recording_in_several_files_is_read_in_their_order(tmp_path):
    recorded = clouds(12)
    for k, message in enumerate(recorded):
        write_mcap(tmp_path / f"drive_{k}", [message])
    assert [len(frame.points) for frame in open_stream(tmp_path)] == list(range(20, 32))  # by their names
    write_mcap(tmp_path / "another", recorded[:1])
    with pytest.raises(MisuseError, match="no stream of scans"):  # nothing says that they belong together
        open_stream(tmp_path)
    (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information:\n")
    assert len(list(open_stream(tmp_path))) >= 12


def test_a_recording_may_be_read_by_another_thread_than_began(opened):
    frames = iter(opened(by_time(clouds(), poses())))
    rest = [next(frames)]
    reader = threading.Thread(target=lambda: rest.extend(frames))
    reader.start()
    reader.join(60.0)
    assert [frame.index for frame in rest] == [0, 1, 2, 3]


@pytest.mark.parametrize("suffix", ["", ".zstd"])
def test_a_recording_that_was_cut_off_is_read_up_to_there(tmp_path, suffix):
    path = write_mcap(tmp_path / "drive", clouds(), use_chunking=False)
    cut = path.read_bytes()[:1700]
    path = path.with_name(f"cut.mcap{suffix}")
    path.write_bytes(zstandard.compress(cut) if suffix else cut)
    stream = open_stream(path)
    assert len(list(stream)) == stream.info.n_frames == 3
    assert stream.faults.skipped == 1


@pytest.mark.parametrize("compressed", ["file", "message"])
def test_a_compressed_recording_has_the_frames_of_the_plain_one(compressed, tmp_path):
    recorded = by_time(clouds(), poses())
    plain = list(open_stream(write_rosbag2(tmp_path / "plain", recorded)))
    folder = write_rosbag2(tmp_path / "packed", recorded, compressed)
    (file,) = folder.glob("*.db3*")
    assert file.name == ("packed.db3.zstd" if compressed == "file" else "packed.db3")
    for path in (folder, file):  # with metadata.yaml and without
        for a, b in zip(plain, open_stream(path), strict=True):
            assert (a.index, a.stamp_s) == (b.index, b.stamp_s)
            assert_array_equal(a.points, b.points)
            assert_array_equal(a.T_world_sensor, b.T_world_sensor)


def test_the_unpacked_file_goes_with_the_stream(tmp_path, monkeypatch):
    folder = write_rosbag2(tmp_path / "drive", clouds(), "file")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    stream = open_stream(folder)
    assert len(list(tmp_path.glob("*.db3"))) == 1
    del stream
    gc.collect()
    assert not list(tmp_path.glob("*.db3"))


def test_a_message_that_claims_to_unpack_to_more_than_any_is_skipped(tmp_path, caplog):
    recorded = clouds()
    recorded[1] = (*recorded[1][:3], zstandard.compress(bytes(2**28 + 1)))
    recorded[2] = (*recorded[2][:3], zstandard.compress(recorded[2][3])[:-9])
    stream = open_stream(write_mcap(tmp_path / "drive", recorded))
    assert [frame.index for frame in stream] == [0, 3]
    assert caplog.text.count("it is not encoded in plain CDR; frame skipped") == 2


def test_scans_go_before_a_recording_beside_them(tmp_path):
    scans = layouts.bare(tmp_path)
    write_mcap(scans / "drive", clouds())
    assert open_stream(scans).info.layout != "rosbag2"


NAMESPACE = "/j100_0000"
MOUNT = ("base_link", "lidar", [1.0, 0.0, 2.0], UP)


def moving(topic, *, with_mount=False):
    """The poses as transforms, of the base in the odometry's frame, with the mount in the same messages or not."""
    recorded = []
    for _, _, recorded_s, _ in poses():
        edges = [("odom", "base_link", [10.0 + recorded_s - 0.001 - BEGAN_S, 0.0, 0.0], UP)]
        message = messages.transforms(*edges, *([MOUNT] if with_mount else []))
        for transform in message.transforms:
            transform.header.stamp.sec, transform.header.stamp.nanosec = divmod(
                round((recorded_s - 0.001) * 1e9), 10**9
            )
        recorded.append((topic, TF, recorded_s, messages.encode(message)))
    return recorded


def static(topic):
    return [(topic, TF, BEGAN_S - 1, messages.encode(messages.transforms(MOUNT)))]


@pytest.mark.parametrize(
    "others",
    [
        by_time(poses("base_link", NAMESPACE + "/odom"), static(NAMESPACE + "/tf_static")),
        by_time(poses("base_link"), moving("/tf", with_mount=True)),
        by_time(moving("/tf"), static("/tf_static")),
        moving(NAMESPACE + "/tf", with_mount=True),
    ],
)
def test_poses_come_from_any_namespace_and_from_transforms(opened, others):
    stream = opened(by_time(clouds(), others))
    assert stream.info.has_poses
    assert x_of(stream) == tenths(4, 11)


@pytest.mark.parametrize(
    ("namespace", "posed"), [({"lidar": "robot/lidar"}, True), ({"lidar": "a/lidar", "x": "b/lidar"}, False)]
)
def test_the_frame_of_the_points_may_lack_the_namespace_of_the_transforms(opened, namespace, posed):
    edges = [("base_link", name, [1.0, 0.0, 2.0], UP) for name in namespace.values()]
    mount = [("/tf_static", TF, BEGAN_S - 1, messages.encode(messages.transforms(*edges)))]
    stream = opened(by_time(clouds(), poses("base_link"), mount))
    assert stream.info.has_poses == posed
    assert not posed or x_of(stream) == tenths(4, 11)


@pytest.mark.parametrize("package", ["livox_ros_driver2", "livox_ros_driver"])
def test_messages_of_livox_own_type_are_read_with_the_times_of_their_points(opened, package, rng):
    xyz = rng.uniform(-20, 20, (500, 3)).astype(np.float32)
    recorded = [
        ("/livox/lidar", f"{package}/msg/CustomMsg", BEGAN_S + k / 10, messages.livox(BEGAN_S + k / 10, xyz, package))
        for k in range(5)
    ]
    frames = [*opened(by_time(recorded, poses("livox_frame")))]
    assert len(frames) == 5
    assert_allclose(frames[1].points[:, 1:3], xyz[:, 1:], atol=1e-6)
    since_middle_s = np.linspace(-0.05, 0.05, 500, endpoint=False)
    assert_allclose(frames[1].points[:, 0], xyz[:, 0] + since_middle_s, atol=1e-3)  # at 1 m/s along x
    assert frames[1].points[0, 3] == pytest.approx(77 / 255)


@pytest.mark.parametrize("kind", ["PoseStamped", "PoseWithCovarianceStamped", "TransformStamped"])
@pytest.mark.parametrize(("mount", "x"), [([static("/tf_static")], 11.0), ([], 10.0)], ids=["of base_link", "of it"])
def test_single_poses_are_used_if_they_are_asked_for(write, tmp_path, kind, mount, x):
    stamps = [BEGAN_S + k / 50 - 0.21 for k in range(40)]
    child = "base_link" if mount else "lidar"
    made = [messages.single_pose(kind, s, [10.0 + s - BEGAN_S, 0.0, 0.0], UP, child) for s in stamps]
    name = f"geometry_msgs/msg/{kind}"
    single = [("/pose", name, s + 0.001, messages.encode(m)) for s, m in zip(stamps, made, strict=True)]
    path = write(tmp_path / "drive", by_time(clouds(), single, *mount))
    unasked = open_stream(path)
    assert not unasked.info.has_poses
    assert "single poses are used if asked for, by --capture odometry=NAME: /pose" in " ".join(
        unasked.info.pose_notes
    )
    stream = open_stream(path, capture={"odometry": "/pose"})
    assert x_of(stream) == tenths(4, x)
    named = kind == "TransformStamped"
    assert named == (not stream.info.pose_notes)


def test_an_option_chooses_one_of_several_topics_of_poses(write, tmp_path):
    recorded = by_time(clouds(), poses(), poses(topic="/wheels"))
    path = write(tmp_path / "drive", recorded)
    assert "--capture odometry=" in " ".join(open_stream(path).info.pose_notes)
    stream = open_stream(path, capture={"odometry": "wheels"})
    assert x_of(stream) == tenths(4, 10)
    assert stream.reading.poses == "/wheels"
    with pytest.raises(MisuseError, match=r"/gps: no poses in this topic; .*/odom, /wheels"):
        open_stream(path, capture={"odometry": "gps"})


@pytest.mark.parametrize(("apart", "lost"), [(1, 0), (4, 1)])
def test_parts_of_turns_that_are_recorded_out_of_order_are_joined_in_theirs(opened, apart, lost):
    """Those that come much later are counted."""
    bearing = np.linspace(np.pi, -np.pi, 3000, endpoint=False)
    recorded = []
    for k in range(36):
        points = np.zeros((1, 1000), messages.XYZ)
        seen = bearing[k % 3 * 1000 :][:1000]
        points["x"], points["y"] = 9 * np.cos(seen), 9 * np.sin(seen)
        stamp_s = BEGAN_S + k / 30
        recorded.append(sweep(stamp_s + 0.03 + (apart + 0.5) / 30 * (k == 20), points, stamp_s=stamp_s))
    stream = opened(by_time(recorded))
    frames = [*stream]
    assert len(frames) == 12
    assert sum(len(frame.points) for frame in frames) == pytest.approx(36_000 - 1000 * lost, abs=5)
    assert stream.faults.left_out.total() == lost
