"""MCAP recordings, read by others' readers and by modt."""

from contextlib import suppress

import numpy as np
import pytest
from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader, make_reader
from rosbags.highlevel import AnyReader

from modt.energy.ledger import StageWork
from modt.energy.meters.meter import Kind
from modt.errors import ModtError
from modt.geometry import rotation_zyx, se3
from modt.schemes import open_sink
from modt.sinks.foxglove_sinks import McapRecorder
from modt.sinks.topics import TopicOptions, topics
from modt.sources.recognise import open_stream
from tests.results import CAR, PEDESTRIAN, energy_window, ledger_line, result, with_kinds
from tests.sinks.recordings import files_of_at_most

OPTIONS = TopicOptions(world_frame_id="world", points=True)


def moving(index):
    """A car and a pedestrian in view, a background in view and a lost car; the sensor looks along the world's y."""
    T = se3(rotation_zyx(0.0, 0.0, np.pi / 2), np.array([3.0 + index, -1.0, 0.5]))
    made = result(
        index, [5, 4, 3], {0: 11, 1: 12, 2: 13}, {11: CAR, 12: PEDESTRIAN, 9: CAR}, lost=(9,), T_world_sensor=T
    )
    made.tracks.x[:, 2:] = np.pi / 2, 2.0
    return made


WINDOW = energy_window(0.5)
LEDGER = ledger_line(1, 3_000_000, tracking=StageWork(cpu_ns=2_000_000))


def read(path, topic=None):
    """Topic, time [ns] and bytes of the messages of a whole file."""
    with path.open("rb") as file:
        found = make_reader(file, validate_crcs=True).iter_messages(topics=topic)
        return [(channel.topic, message.log_time, message.data) for _, channel, message in found]


def n_frames(path):
    """Frames in a file that may end anywhere."""
    count = 0
    with path.open("rb") as file, suppress(EndOfFile):
        for _ in NonSeekingReader(file).iter_messages(topics="/modt/markers", log_time_order=False):
            count += 1
    return count


def record(path, *frames, records=()):
    sink = McapRecorder(path, OPTIONS)
    for frame in frames:
        sink.write(frame)
    for line in records:
        sink.ledger(line)
    sink.close()


def test_another_reader_of_ros_2_finds_what_the_topics_hold(tmp_path):
    unknown = energy_window(None, kind=Kind.UNAVAILABLE)
    record(tmp_path / "a.mcap", moving(3), records=(WINDOW, unknown, LEDGER))
    with AnyReader([tmp_path / "a.mcap"]) as reader:
        found = {c.topic: (raw, reader.deserialize(raw, c.msgtype), stamp) for c, stamp, raw in reader.messages()}
    assert {stamp for *_, stamp in found.values()} == {300_000_000}
    for topic in topics(OPTIONS):
        assert found.pop(topic.name)[0] == topic.encode(moving(3))
    assert {name: message.data for name, (_, message, _) in found.items()} == {
        "/modt/energy/mJ_per_frame": 50.0,
        "/modt/energy/watts": 0.5,
        "/modt/energy/kind": "measured",
        "/modt/cpu_ms/total": 3.0,
        "/modt/cpu_ms/tracking": 2.0,
    }


def test_obstacles_and_ground_are_recorded_by_request(tmp_path):
    made = with_kinds(moving(3))
    for option, extra in (("", set()), ("&obstacles=all", {"/modt/obstacles", "/modt/ground"})):
        path = tmp_path / f"{len(extra)}.mcap"
        sink = open_sink(f"mcap://{path}?points=none{option}")
        sink.write(made)
        sink.close()
        assert {topic for topic, *_ in read(path)} == {
            "/modt/detections",
            "/modt/markers",
            "/modt/odometry",
            "/modt/diagnostics",
            "/tf",
            *extra,
        }
    encoded = {topic.name: topic.encode(made) for topic in topics(TopicOptions(obstacles=True))}
    for topic in extra:
        assert [data for *_, data in read(path, topic)] == [encoded[topic]]


def test_modt_itself_replays_the_points_and_the_poses(tmp_path):
    record(tmp_path / "a.mcap", *map(moving, range(5)))
    frames = list(open_stream(tmp_path / "a.mcap"))
    assert len(frames) == 5
    for k, frame in enumerate(frames):
        sent = moving(k)
        assert frame.stamp_s == pytest.approx(0.1 * k)
        np.testing.assert_array_equal(frame.points[:, :3], sent.frame.points[:, :3])
        np.testing.assert_allclose(frame.T_world_sensor, sent.T_world_sensor, atol=1e-9)


def test_the_oldest_parts_make_room_and_nothing_else(tmp_path, rng):
    (tmp_path / "a-note.mcap").write_bytes(bytes(100_000))
    sizes = []
    limit = 200_000
    sink = McapRecorder(tmp_path / "a.mcap", OPTIONS, max_bytes=limit)
    for k in range(200):
        frame = moving(k)
        frame.frame.points[:] = rng.normal(size=frame.frame.points.shape)
        sink.write(frame)
        sink._writer.flush()
        sizes.append(sum(path.stat().st_size for path in parts(tmp_path)))
    sink.close()
    assert (tmp_path / "a-note.mcap").exists()
    assert not (tmp_path / "a.mcap").exists()
    assert len(parts(tmp_path)) > 3
    assert max(sizes) < limit * 1.1
    assert sum(n_frames(path) for path in parts(tmp_path)) > 50


def parts(folder):
    return [path for path in folder.iterdir() if path.name != "a-note.mcap"]


def test_a_second_old_frame_survives_a_crash(tmp_path):
    now_s = iter(np.arange(0.0, 100.0, 0.3).tolist())
    sink = McapRecorder(tmp_path / "a.mcap", TopicOptions(), clock=lambda: next(now_s))
    for k in range(20):
        sink.write(moving(k))
    (tmp_path / "crashed.mcap").write_bytes((tmp_path / "a.mcap").read_bytes())
    sink.close()
    assert n_frames(tmp_path / "crashed.mcap") >= 20 - 4
    assert n_frames(tmp_path / "a.mcap") == 20


def test_a_full_disk_is_an_error_and_the_recording_goes_on_when_there_is_room(tmp_path):
    sink = McapRecorder(tmp_path / "a.mcap", TopicOptions(), clock=iter(range(1000)).__next__)
    sink.write(moving(0))
    with files_of_at_most(0):
        for k in range(1, 4):
            with pytest.raises(ModtError, match="cannot be written"):
                sink.write(moving(k))
    sink.write(moving(4))
    sink.close()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a-1.mcap", "a.mcap"]
    assert [stamp for _, stamp, _ in read(tmp_path / "a-1.mcap", "/modt/markers")] == [400_000_000]
