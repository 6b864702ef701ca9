"""Tracks, points and labelled objects as the page draws them."""

import numpy as np
import pytest

from modt.classes import CLASS_NAMES
from modt.geometry import rotation_zyx, se3
from modt.profile import load
from modt.sinks.tracks import BOX_KEYS, WORLD_KEYS
from modt.viewer.packed import LEVELS, PLAIN, SIDE
from modt.viewer.theme import REACH_M
from modt.viewer.track_rows import COLUMNS, SCALE
from modt_evaluation.recorded_result import recorded_result
from modt_evaluation.truth import KITTI_TYPES, FrameTruth
from modt_simulation.synthetic_stream import SyntheticStream
from modt_viewer.recorded_run import frame_rows, reach_m, track_table
from modt_viewer.truth_marks import _objects
from modt_viewer.view import Grid


def track(id_, box, world, state="tracked"):
    """A track of a line of tracks.jsonl."""
    return {
        "id": id_, "state": state, "class": "car", "posterior": [0.1, 0.7, 0.15, 0.05],
        "witness": [0.0, 1.5, -0.6, 0.2], "viewed": True, "final": False, "heading_known": False, "size": [0.0] * 3,
        "motion": "unknown", "moving": 0.5, "velocity": [0.0] * 2, "velocity_covariance": [0.0] * 3,
        "proposal": None if box is None else 0, "points": 12, "age": 3, "missed": 0,
        **dict.fromkeys(("box", "seen"), None if box is None else dict(zip(BOX_KEYS, box, strict=True))),
        "world": dict(zip(WORLD_KEYS, world, strict=True)),
    }  # fmt: skip


def posts(x):
    """Two things that stand, seen by a sensor that has gone x ahead and turned to the left by a quarter."""
    return [track(k, (y, x, 0, 1, 1, 1, 0), (0.0, y, 0, 0)) for k, y in ((7, 5.0), (8, -9.0))]


def recorded(at, *tracks, **more):
    """The result of a line of tracks.jsonl, `at` metres along the world's x, where the sensor looks along its y."""
    T = se3(rotation_zyx(0.0, 0.0, np.pi / 2), np.array([at, 0.0, 0.0]))
    counts = {"proposals": 1, "classifications": 0, "deferred": 0, "classified": [], "run": None}
    pose = {"frame": at, "stamp_s": 0.0, "T_world_sensor": T[:3].ravel().tolist()}
    return recorded_result({**pose, "tracks": [*tracks], **counts, **more})


def test_rows_are_sorted_by_track_and_a_lost_box_stays_in_the_world():
    seen = track(3, (4, 0, -1, 4.5, 1.8, 1.5, 0.5), (0, 4, 0, 1.0))
    lost = track(3, None, (0, 6, 0, 1.0), "lost")
    records = [recorded(0, *posts(0.0), seen, classified=[3]), recorded(1, lost, *posts(1.0))]
    states = list[str]()
    boxes = dict[int, np.ndarray]()
    table = track_table(frame_rows(at, record, states, boxes) for at, record in enumerate(records))
    assert states == ["tracked", "lost"]
    rows = [dict(zip(COLUMNS, row, strict=True)) for row in table.tolist()]
    assert [(row["id"], row["at"]) for row in rows] == [(3, 0), (3, 1), (7, 0), (7, 1), (8, 0), (8, 1)]
    assert [(row["seen"], row["classified"], row["state"]) for row in rows[:2]] == [(1, 1, 0), (0, 0, 1)]
    assert [rows[1][key] for key in BOX_KEYS] == [600, 100, -100, 450, 180, 150, 500]
    assert [rows[0][f"p_{name}"] for name in CLASS_NAMES] == [100, 700, 150, 50]
    assert [rows[0][f"motion_{name}"] for name in CLASS_NAMES] == [0, 150, -60, 20]
    assert [rows[1][f"world_{key}"] for key in WORLD_KEYS] == [0, 600, 0, 100]


def rows(x, y=0.0, seen=1):
    table = np.zeros((len(x), len(COLUMNS)), np.int64)
    for name, values in {"x": x, "y": y}.items():
        table[:, COLUMNS.index(name)] = np.multiply(values, SCALE[name])
    table[:, COLUMNS.index("seen")] = seen
    return table


FAR = rows([60])
LOST = rows([60] * 50, seen=0)


@pytest.mark.parametrize(
    ("table", "reach"),
    [
        (rows([3, -4], [0, 1]), 6.0),
        (rows([3, 1], [0, 12]), 20.0),
        (rows([-25], [2]), 30.0),
        (rows([80], [2]), REACH_M),
        (track_table([]), REACH_M),
        (np.concatenate([rows(np.linspace(-8, 8, 40)), FAR, LOST]), 10.0),
    ],
    ids=["room", "hall", "street", "beyond", "no track", "one far and lost ones"],
)
def test_a_room_is_shown_larger_than_a_street(table, reach):
    assert reach_m(table) == reach


def test_a_cell_has_the_heights_of_its_points_the_highest_on_top_and_ground_as_such():
    config = load("vlp-16")
    points = next(iter(SyntheticStream("street", "vlp-16", 0.1, seed=2))).points
    grid = Grid(config)
    pole = np.zeros((5, 4), np.float32)
    pole[:, :2] = 9.01, -4.01
    pole[:, 2] = -config.sensor.height_m + np.array([0.5, 2.0, 1.0, 1.5, 0.7])
    without, cells = (grid.cells(given) for given in (points, np.concatenate([points, pole])))
    column, row = (int(np.floor(v * 100 / grid.step_cm)) + SIDE // 2 for v in (9.01, -4.01))
    levels = cells.level[cells.cell == SIDE * row + column]
    assert len(levels) == len(pole)
    level = levels[-1]
    assert 18 <= level <= 22
    assert (np.diff((cells.cell * (PLAIN + 1) + cells.group) * LEVELS + cells.level) > 0).all()
    ground = without.level == 0
    assert 0.2 < ground.mean() < 0.9
    x = ((without.cell % SIDE) + 0.5 - SIDE / 2) * grid.step_cm / 100
    assert np.abs(x).max() < config.sensor.max_range_m


def test_an_object_is_drawn_where_the_sensor_sees_it():
    T = se3(np.eye(3), np.array([10.0, 0.0, 0.0]))
    boxes = [[14, 2, 0, 4, 2, 1.5, 0.1], [15, 2, 0, 1, 1, 1.5, 0], [16, 2, 0, 4, 2, 1.5, 0], [0, 0, 0, 1, 1, 1, 0]]
    truth = FrameTruth.of(KITTI_TYPES, [1, 2, 3, 4], ["Car", "Pedestrian", "Car", "Tram"], boxes, T_box_sensor=T)
    rows = np.zeros(4, [("reported", int), ("class", int), ("to_segment", bool), ("to_classify", bool)])
    rows["class"] = truth.object_class
    rows["reported"] = [1, 1, -1, 1]
    rows["to_segment"] = [1, 1, 0, 1]
    rows["to_classify"] = [1, 1, 1, 1]
    objects = _objects(truth, rows)
    assert [(o["class"], o["outcome"]) for o in objects] == [(1, "found"), (2, "missed"), (1, "not judged")]
    assert [objects[0][key] for key in ("x", "y", "l", "w", "yaw")] == pytest.approx([4, 2, 4, 2, 0.1])
