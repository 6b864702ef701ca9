"""Boxes of whole objects, from the parts that frames show."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from modt.app.assembly import MODES, chosen_kernels, pipeline
from modt.classes import ObjectClass
from modt.geometry import FieldOfView, upright_boxes, wrap
from modt.object_box.estimator import SeenBoxes, WholeBoxes
from modt.object_box.native_estimator import NativeWholeBoxes, whole_boxes_of
from modt.placement import Placement
from modt.profile import load
from modt.types import NONE, Decisions, Motion, MotionState, ObjectBoxes, Proposals
from modt_simulation.synthetic_stream import SyntheticStream

CAR = np.array([12.0, 5.0, -1.0, 4.2, 1.8, 1.5, 0.6])
REAR = np.array([15.0, 0.0, -1.0, 4.2, 1.8, 1.5, 0.0])
WALKER = np.array([8.0, -3.0, -0.9, 1.0, 0.6, 1.7, 2.0])


def visible_points(box, sides=("near", "side")):
    """(3, n) points on the faces of a box [sensor frame] that a sensor at the origin sees."""
    rng = np.random.default_rng(0)
    length, width, height = box[3:6]
    c, s = np.cos(box[6]), np.sin(box[6])
    u, v = -(c * box[0] + s * box[1]), -(c * box[1] - s * box[0])  # the sensor, from the box
    n = 300
    faces = []
    if abs(u) > length / 2 and "near" in sides:
        faces.append((np.full(n, np.copysign(length / 2, u)), rng.uniform(-width / 2, width / 2, n)))
    if abs(v) > width / 2 and "side" in sides:
        faces.append((rng.uniform(-length / 2, length / 2, n), np.full(n, np.copysign(width / 2, v))))
    x, y = np.concatenate(faces, axis=1)
    z = box[2] + rng.uniform(-height / 2, height / 2, len(x))
    z[0] = box[2] + height / 2
    return np.array([box[0] + c * x - s * y, box[1] + s * x + c * y, z], np.float32)


def proposals_of(groups, yaw):
    """Proposals of groups of points, with boxes at the given headings."""
    offsets = np.append(0, np.cumsum([group.shape[1] for group in groups]))
    coordinates = np.ascontiguousarray(np.concatenate(groups, axis=1))
    return Proposals(
        members=np.arange(offsets[-1]),
        offsets=offsets,
        coordinates=coordinates,
        centroid=np.array([group.mean(axis=1) for group in groups], np.float64),
        box=upright_boxes(coordinates, offsets, np.asarray(yaw)),
        cut=np.zeros(len(groups), np.int64),
    )


class Scene:
    """Tracks of objects before a sensor at the origin of the world."""

    def __init__(self, estimator, classes):
        self.estimator = estimator
        self.own = ObjectBoxes.blank(len(classes))
        self.decisions = Decisions.blank(len(classes))
        self.decisions.object_class[:] = classes
        self.motion = Motion.blank(len(classes))
        self.motion.motion[:] = MotionState.STILL

    def show(self, groups, yaw):
        """A frame with the points of every object, whose fitted boxes have these headings; their whole boxes."""
        proposals = proposals_of(groups, yaw)
        self.motion.box[:] = proposals.box
        self.motion.proposal[:] = np.arange(len(groups))
        self.motion.x[:, :2] = proposals.box[:, :2]
        self.estimator.estimate(self.own, self.motion, self.decisions, proposals, Placement(np.eye(4)))
        return self.own.whole_box.copy()

    def show_car(self):
        return self.show([visible_points(CAR)], [CAR[6]])

    def hide(self, step):
        """A frame without proposals, in which the tracks move on by a step."""
        self.motion.proposal[:] = NONE
        self.motion.x[:, :2] += step
        none = Proposals.empty()
        self.estimator.estimate(self.own, self.motion, self.decisions, none, Placement(np.eye(4)))
        return self.own.whole_box.copy()

    def move(self, velocity):
        self.motion.motion[:] = MotionState.MOVING
        self.motion.velocity[:] = velocity
        self.motion.velocity_covariance[:] = 0.01 * np.eye(2)


@pytest.fixture(name="estimator", params=["numpy", "auto"])
def an_estimator(request, monkeypatch):
    monkeypatch.delenv("MODT_KERNELS", raising=False)
    return whole_boxes_of(chosen_kernels(request.param))


@pytest.fixture(name="scene")
def a_scene_of_one_car(estimator):
    return Scene(estimator, [ObjectClass.CAR])


def angle(a, b, period=np.pi):
    """Difference of two headings that are alike after a period."""
    return abs((a - b + period / 2) % period - period / 2)


def test_a_car_seen_at_a_corner_is_found_whole(scene):
    for _ in range(20):
        (box,) = scene.show_car()
    assert_allclose(box[:2], CAR[:2], atol=0.1)
    assert_allclose(box[3:6], CAR[3:6], atol=0.15)
    assert angle(box[6], CAR[6]) < 0.02
    assert not scene.own.heading_known[0]


def test_a_car_of_which_the_rear_is_seen_reaches_away_from_the_sensor(scene):
    for _ in range(20):
        (box,) = scene.show([visible_points(REAR, ["near"])], [np.pi / 2])
    assert angle(box[6], REAR[6]) < 0.02
    assert_allclose(box[3:5], REAR[3:5], atol=0.2)
    assert_allclose(box[:2], REAR[:2], atol=0.15)


def test_what_moves_heads_where_it_goes(estimator):
    scene = Scene(estimator, [ObjectClass.CAR, ObjectClass.PEDESTRIAN])
    scene.move([[np.cos(-2.5), np.sin(-2.5)], [np.cos(2.0), np.sin(2.0)]])
    for _ in range(5):
        boxes = scene.show([visible_points(CAR), visible_points(WALKER)], [CAR[6], WALKER[6]])
    assert angle(boxes[1, 6], WALKER[6], 2 * np.pi) < 0.1
    assert scene.own.heading_known.all()
    assert_allclose(boxes[1, :2], WALKER[:2], atol=0.25)
    assert angle(boxes[0, 6], CAR[6] - np.pi, 2 * np.pi) < 0.2  # a car that reverses, as far as one can tell


def test_a_parked_car_does_not_jump_by_a_quarter_turn(scene):
    rng = np.random.default_rng(1)
    whole = visible_points(CAR)
    near = visible_points(CAR, ["near"])
    headings = []
    for k in range(60):
        yaw = CAR[6] + (np.pi / 2 if rng.random() < 0.3 else 0.0)
        (box,) = scene.show([near if k > 5 and rng.random() < 0.4 else whole], [yaw])
        headings.append(box[6])
    assert np.abs(wrap(np.diff(headings))).max() < 0.1


def middle_of_the_flank(box):
    """(3, n) points of a flank of which 1.7 m are seen, as long as a car is wide."""
    flank = visible_points(box, ["side"])
    along = np.cos(box[6]) * (flank[0] - box[0]) + np.sin(box[6]) * (flank[1] - box[1])
    return np.ascontiguousarray(flank[:, np.abs(along) < 0.85])


@pytest.mark.parametrize(
    ("ahead_m", "beside_m", "in_line"), [(25.0, 0.0, True), (1.0, -2.0, True), (35.0, 0.0, False), (8.0, 5.0, False)]
)
def test_a_car_seen_in_part_stands_as_one_in_line_with_it(estimator, ahead_m, beside_m, in_line):
    scene = Scene(estimator, [ObjectClass.CAR, ObjectClass.CAR])
    other = CAR.copy()
    c, s = np.cos(CAR[6]), np.sin(CAR[6])
    other[:2] += ahead_m * c - beside_m * s, ahead_m * s + beside_m * c
    for _ in range(15):
        boxes = scene.show([middle_of_the_flank(CAR), visible_points(other)], [CAR[6]] * 2)
    assert (angle(boxes[0, 6], CAR[6]) < 0.1) == in_line


def test_a_box_that_was_turned_wrongly_turns_once_the_long_side_is_seen(scene):
    (first,) = scene.show([middle_of_the_flank(CAR)], [CAR[6]])
    for _ in range(10):
        (box,) = scene.show_car()
    assert angle(first[6], CAR[6] + np.pi / 2) < 0.1  # headings are tried at every 5 degrees
    assert angle(box[6], CAR[6]) < 0.05
    assert_allclose(box[3:5], CAR[3:5], atol=0.3)


def test_the_box_of_a_hidden_track_moves_on_with_it(scene):
    (seen,) = scene.show_car()
    (hidden,) = scene.hide([1.0, -0.5])
    assert_allclose(hidden[:2] - seen[:2], [1.0, -0.5])
    assert_array_equal(hidden[2:], seen[2:])


def test_background_has_the_box_last_seen(estimator):
    scene = Scene(estimator, [ObjectClass.BACKGROUND])
    (box,) = scene.show_car()
    assert_array_equal(box, scene.motion.box[0])


def test_the_box_stands_on_the_ground(estimator):
    scene = Scene(estimator, [ObjectClass.PEDESTRIAN])
    legless = visible_points(WALKER)
    legless = np.ascontiguousarray(legless[:, legless[2] > -1.2])
    proposals = proposals_of([legless], [WALKER[6]])
    scene.motion.box[:] = proposals.box
    scene.motion.proposal[:] = 0
    on_ground = Proposals(
        *(getattr(proposals, name) for name in ("members", "offsets", "coordinates", "centroid", "box", "cut")),
        ground_z_m=np.array([-1.75]),
    )
    estimator.estimate(scene.own, scene.motion, scene.decisions, on_ground, Placement(np.eye(4)))
    box = scene.own.whole_box[0]
    assert box[2] - box[5] / 2 == pytest.approx(-1.75)
    assert box[5] == pytest.approx(1.7, abs=0.1)


def test_merged_objects_leave_the_size_as_it_was(scene):
    for _ in range(10):
        (before,) = scene.show_car()
    merged = CAR.copy()
    merged[3:5] = 9.0, 4.0
    (box,) = scene.show([visible_points(merged)], [CAR[6]])
    assert_allclose(box[3:5], before[3:5])


def test_compiled_boxes_are_those_of_numpy_to_the_byte(monkeypatch):
    monkeypatch.delenv("MODT_KERNELS", raising=False)
    kernels = chosen_kernels("auto")
    native = whole_boxes_of(kernels)
    if not isinstance(native, NativeWholeBoxes):
        pytest.skip("no compiled kernels")
    reference = WholeBoxes(kernels)
    rng = np.random.default_rng(5)
    n = 60
    classes = rng.integers(0, 4, n)
    scenes = [Scene(native, classes), Scene(reference, classes)]
    for _ in range(12):
        boxes = rng.uniform([-30, -30, -2, 0.3, 0.3, 0.5, -3], [30, 30, 0, 6, 3, 2, 3], (n, 7))
        groups = [rng.uniform(-1, 1, (3, count)) for count in rng.integers(1, 40, n)]
        groups = [(b[:3, None] + b[3:6, None] * g / 2).astype(np.float32) for b, g in zip(boxes, groups, strict=True)]
        motion = rng.integers(0, 3, n)
        velocity = rng.normal(0, 2, (n, 2))
        moved_m = rng.uniform(0, 1, n)
        covariance = rng.normal(0, 0.3, (n, 2, 2))
        for scene in scenes:
            scene.motion.motion[:] = motion
            scene.motion.velocity[:] = velocity
            scene.motion.moved_m[:] = moved_m
            scene.motion.velocity_covariance[:] = covariance @ covariance.transpose(0, 2, 1)
            scene.show(groups, boxes[:, 6])
        for name, column in scenes[0].own.columns().items():
            assert_array_equal(column, getattr(scenes[1].own, name), err_msg=name)
        if rng.random() < 0.3:
            assert_array_equal(*(scene.hide([0.1, 0.2]) for scene in scenes))


def test_the_paper_s_tracks_have_the_boxes_seen():
    scene = Scene(SeenBoxes(), [ObjectClass.CAR])
    (box,) = scene.show_car()
    assert_array_equal(box, scene.motion.box[0])


def test_every_track_of_a_drive_has_a_box():
    mode = MODES["accurate"]
    profile = load("vlp-16")
    stages = pipeline(mode, profile, FieldOfView())
    for frame in SyntheticStream("street", "vlp-16", 1.0, seed=4):
        tracks = stages.step(frame, mode.budget(profile)).tracks
        assert np.isfinite(tracks.whole_box).all()
        assert (tracks.whole_box[:, 3:6] >= 0).all()
