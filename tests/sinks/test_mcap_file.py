"""MCAP recordings, read by the public reader."""

import base64
from contextlib import suppress

import numpy as np
import pytest

pytest.importorskip("foxglove")
pytest.importorskip("mcap")

from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader, make_reader

from modt.classes import CLASSES, ObjectClass
from modt.errors import ModtError
from modt.geometry import rotation_zyx, se3
from modt.schemes import open_sink
from modt.sinks.mcap_file import McapFile
from tests.results import CAR, PEDESTRIAN, result
from tests.sinks.foxglove_messages import decoded
from tests.sinks.full_disk import files_of_at_most


def moving(index, speed_mps=2.0):
    """A car and a pedestrian in view, a background in view and a lost car; the sensor looks along the world's y."""
    T = se3(rotation_zyx(0.0, 0.0, np.pi / 2), np.array([3.0, -1.0, 0.5]))
    made = result(
        index, [5, 4, 3], {0: 11, 1: 12, 2: 13}, {11: CAR, 12: PEDESTRIAN, 9: CAR}, lost=(9,), T_world_sensor=T
    )
    made.tracks.x[:, 2], made.tracks.x[:, 3] = np.pi / 2, speed_mps
    return made


WINDOW = {"schema": "modt.energy/1", "frames": [0, 9, 10], "wall_ns": 10**9, "energy_J": 0.5, "kind": "measured"}
LEDGER = {"schema": "modt.ledger/1", "frame": 1, "cpu_ns": 3_000_000, "stages": {"tracking": {"cpu_ns": 2_000_000}}}


def read(path, topic=None):
    """Topic, schema, time [ns] and content of the messages of a whole file."""
    with path.open("rb") as file:
        return [
            (c.topic, s.name, m.log_time, decoded(c.message_encoding, s.name, s.data, m.data))
            for s, c, m in make_reader(file, validate_crcs=True).iter_messages(topics=topic)
        ]


def n_frames(path):
    """Frames in a file that may end anywhere."""
    count = 0
    with path.open("rb") as file, suppress(EndOfFile):
        for _ in NonSeekingReader(file).iter_messages(topics="/tracks", log_time_order=False):
            count += 1
    return count


def record(path, *frames, records=(), **options):
    sink = McapFile(path, **{"points": True, **options})
    for frame in frames:
        sink.write(frame)
    for line in records:
        sink.ledger(line)
    sink.close()


def test_topics_have_the_schemas_that_foxglove_knows(tmp_path):
    record(tmp_path / "a.mcap", moving(3), records=(WINDOW, LEDGER))
    found = {topic: (schema, stamp) for topic, schema, stamp, _ in read(tmp_path / "a.mcap")}
    assert found == {
        "/tf": ("foxglove.FrameTransform", 300_000_000),
        "/tracks": ("foxglove.SceneUpdate", 300_000_000),
        "/points": ("foxglove.PointCloud", 300_000_000),
        "/energy": ("modt.Energy", 300_000_000),
        "/stages": ("modt.Stages", 300_000_000),
    }


def test_the_pose_of_the_sensor_is_a_transform_from_the_world(tmp_path):
    record(tmp_path / "a.mcap", moving(3))
    ((*_, placed),) = read(tmp_path / "a.mcap", "/tf")
    assert (placed["parent_frame_id"], placed["child_frame_id"]) == ("world", "sensor")
    assert placed["translation"] == {"x": 3.0, "y": -1.0, "z": 0.5}
    turned = [placed["rotation"].get(key, 0.0) for key in "xyzw"]
    np.testing.assert_allclose(turned, [0, 0, np.sqrt(0.5), np.sqrt(0.5)], atol=1e-12)


def test_an_object_in_view_has_a_cube_a_text_and_an_arrow_along_its_motion(tmp_path):
    record(tmp_path / "a.mcap", moving(3))
    ((*_, update),) = read(tmp_path / "a.mcap", "/tracks")
    assert [deletion["type"] for deletion in update["deletions"]] == ["ALL"]
    car, person = update["entities"]
    assert (car["id"], person["id"]) == ("11", "12")
    assert car["frame_id"] == "sensor"
    assert car["metadata"] == [{"key": "class", "value": "car"}]
    (cube,) = car["cubes"]
    assert cube["size"] == {"x": 4.0, "y": 2.0, "z": 1.5}
    assert cube["pose"]["position"] == {"x": 10.0, "z": -1.0}
    colour = [round(255 * cube["color"][part]) for part in "rgb"]
    assert bytes(colour).hex() == CLASSES[ObjectClass.CAR].colour[1:]
    assert [text["text"] for text in (*car["texts"], *person["texts"])] == [
        "car 11: 2.0 m/s",
        "pedestrian 12: 2.0 m/s",
    ]
    (arrow,) = car["arrows"]
    assert arrow["shaft_length"] == 2.0
    assert arrow["pose"]["orientation"].get("z", 0.0) == pytest.approx(0.0)  # the world's y is straight ahead


def test_the_arrow_of_what_goes_backwards_points_there(tmp_path):
    record(tmp_path / "a.mcap", moving(3, speed_mps=-2.0))
    ((*_, update),) = read(tmp_path / "a.mcap", "/tracks")
    (arrow,) = update["entities"][0]["arrows"]
    assert arrow["shaft_length"] == 2.0
    assert abs(arrow["pose"]["orientation"]["z"]) == pytest.approx(1.0)


def test_what_stands_has_no_arrow(tmp_path):
    record(tmp_path / "a.mcap", moving(3, speed_mps=0.0))
    ((*_, update),) = read(tmp_path / "a.mcap", "/tracks")
    assert [entity.get("arrows") for entity in update["entities"]] == [None, None]


def test_points_are_those_of_the_frame(tmp_path):
    frame = moving(3)
    record(tmp_path / "a.mcap", frame)
    ((*_, cloud),) = read(tmp_path / "a.mcap", "/points")
    assert [(field["name"], field.get("offset", 0)) for field in cloud["fields"]] == [
        ("x", 0),
        ("y", 4),
        ("z", 8),
        ("reflectance", 12),
    ]
    assert cloud["point_stride"] == 16
    assert base64.b64decode(cloud["data"]) == frame.frame.points.tobytes()


def test_points_can_be_left_out(tmp_path):
    sink = open_sink(f"mcap://{tmp_path}/a.mcap?points=none")
    sink.write(moving(3))
    sink.close()
    assert {topic for topic, *_ in read(tmp_path / "a.mcap")} == {"/tf", "/tracks"}


def test_energy_a_frame_is_that_of_its_window(tmp_path):
    unknown = {**WINDOW, "energy_J": None, "kind": "unavailable"}
    record(tmp_path / "a.mcap", moving(0), records=(WINDOW, unknown, LEDGER))
    found = {topic: content for topic, *_, content in read(tmp_path / "a.mcap", ["/energy", "/stages"])}
    assert found == {
        "/energy": {"mJ_per_frame": 50.0, "watts": 0.5, "kind": "measured"},
        "/stages": {"cpu_ms": 3.0, "tracking_ms": 2.0},
    }


def test_an_earlier_recording_is_kept(tmp_path):
    for _ in range(3):
        record(tmp_path / "a.mcap", moving(0))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a-1.mcap", "a-2.mcap", "a.mcap"]


def test_the_oldest_parts_make_room_and_nothing_else(tmp_path):
    (tmp_path / "a-note.mcap").write_bytes(bytes(100_000))
    sizes = []
    limit = 200_000
    sink = McapFile(tmp_path / "a.mcap", points=True, max_bytes=limit)
    rng = np.random.default_rng(0)
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
    sink = McapFile(tmp_path / "a.mcap", points=False, clock=lambda: next(now_s))
    for k in range(20):
        sink.write(moving(k))
    (tmp_path / "crashed.mcap").write_bytes((tmp_path / "a.mcap").read_bytes())
    sink.close()
    assert n_frames(tmp_path / "crashed.mcap") >= 20 - 4
    assert n_frames(tmp_path / "a.mcap") == 20


def test_a_full_disk_is_an_error_and_the_recording_goes_on_when_there_is_room(tmp_path):
    sink = McapFile(tmp_path / "a.mcap", points=False, clock=iter(range(1000)).__next__)
    sink.write(moving(0))
    with files_of_at_most(0):
        for k in range(1, 4):
            with pytest.raises(ModtError, match="cannot be written"):
                sink.write(moving(k))
    sink.write(moving(4))
    sink.close()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a-1.mcap", "a.mcap"]
    assert [stamp for *_, stamp, _ in read(tmp_path / "a-1.mcap", "/tracks")] == [400_000_000]
