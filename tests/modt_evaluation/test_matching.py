import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.classes import ObjectClass
from modt.geometry import Camera, FieldOfView, rotation_zyx, se3, transform
from modt.types import NONE
from modt_evaluation.matching import judge
from modt_evaluation.overlap import Overlap, inside
from modt_evaluation.rows import Outcome
from modt_evaluation.rules import CUBOID_RULES, KITTI_RULES
from modt_evaluation.truth import KITTI_TYPES, PANDASET_TYPES, PAPER_TYPES, FrameTruth, Regions
from tests.modt_evaluation.scenes import blob, car, cars, frame

CAR = ObjectClass.CAR
BACKGROUND = ObjectClass.BACKGROUND
AHEAD_CAMERA = Camera(np.array([[500.0, -700, 0, 0], [180, 0, -700, 0], [1, 0, 0, 0]]), np.eye(4), 1000.0, 360.0)


def counting(*what):
    return dataclasses.replace(KITTI_RULES, ignored=KITTI_RULES.ignored - set(what))


ONE = [(7, 0, "car")]
TWO = [(7, 0, "car"), (8, 1, "car")]
OBJECT = ["to_segment", "to_classify", "to_follow"]
PROPOSAL = ["to_classify", "to_report", "to_associate"]


def judged(truth, blobs, tracks=ONE, rules=KITTI_RULES, **more):
    """Objects and proposals of a frame."""
    return judge(frame(truth, blobs, tracks, **more), rules)[:2]


HALF = [(blob(28, 10), 0), (blob(12, 10), NONE), (blob(27, 10, 5), 0)]
"""A proposal of most of a car and as much of something else."""


@pytest.mark.parametrize(
    ("blobs", "outcome"),
    [
        ([(blob(40, 10), 0)], Outcome.DETECTED),
        ([(blob(40, 10), 0), (blob(50, 10, 5), 0)], Outcome.MERGED),
        ([(blob(19, 10), 0), (blob(19, 9.8), 1), (blob(2, 10), NONE)], Outcome.SPLIT),
        (HALF, Outcome.PARTIAL),
        ([(blob(15, 10), 0), (blob(25, 10), NONE)], Outcome.MISSED),
        ([(blob(40, 10), NONE)], Outcome.MISSED),
    ],
)
def test_outcomes_of_segmentation(blobs, outcome):
    objects, _ = judged(cars(10.0), blobs, [])
    assert objects["to_segment"].all()
    assert objects["outcome"].tolist() == [outcome]


def test_points_near_the_ground_are_of_the_box_but_not_of_the_object():
    low = blob(30, 10)
    low[:, 2] = -1.6  # 0.1 m above the foot
    objects, proposals = judged(cars(10.0), [(blob(40, 10), 0), (low, 1)], TWO)
    assert objects["outcome"].tolist() == [Outcome.DETECTED]
    assert proposals["label"].tolist() == [CAR, BACKGROUND]
    assert proposals["box_class"].tolist() == [CAR, CAR]


@pytest.mark.parametrize(("rules", "label"), [(KITTI_RULES, CAR), (CUBOID_RULES, BACKGROUND)])
def test_half_of_each_other_or_iou(rules, label):
    assert judged(cars(10.0), HALF, rules=rules)[1]["label"].tolist() == [label]


def test_objects_of_few_points():
    few = cars(10.0), [(blob(9, 10), 0)]
    objects, proposals = judged(*few)
    assert objects[OBJECT].tolist() == [(False, False, False)]
    assert not proposals["to_classify"][0]
    assert judged(*few, rules=counting("few"))[1]["to_classify"][0]
    assert judged(cars(10.0), [(blob(15, 10), 0)])[0][["to_segment", "to_follow"]].tolist() == [(False, True)]


def test_objects_cut_by_the_view():
    left = FieldOfView(np.array([[0.0, 1.0, 0.0, 0.0]]))
    cut = cars(10.0), [(blob(30, 10, -0.4), 0), (blob(20, 10, 0.4), 0)]
    objects, proposals = judged(*cut, fov=left)
    assert objects[["in_view", *OBJECT]].tolist() == [(False, False, False, True)]
    assert not proposals["to_classify"][0]
    counted, rows = judged(*cut, fov=left, rules=counting("cut"))
    assert counted[OBJECT].tolist() == [(True, True, True)]
    assert rows["label"][0] == CAR


def test_beyond_the_labelled_sector_only_the_life_of_tracks_is_judged():
    objects, proposals = judged(FrameTruth.of(KITTI_TYPES, [0], ["Car"], [car(1.0, 10.0)]), [(blob(30, 1, 10), 0)])
    assert objects[OBJECT].tolist() == [(True, False, True)]
    assert not proposals["to_report"][0]


def test_parked_cars_outside_their_labels():
    nothing = FrameTruth.of(KITTI_TYPES, [], [], [], parked=np.array([car(10.0)]))
    blobs = [(blob(30, 10), 0), (blob(30, 30), 1)]
    assert judged(nothing, blobs, TWO)[1][PROPOSAL].tolist() == [(False,) * 3, (True,) * 3]
    assert judged(nothing, blobs, TWO, counting("parked"))[1][PROPOSAL].tolist() == [(True,) * 3] * 2
    labelled = dataclasses.replace(cars(10.0), parked=nothing.parked)
    assert judged(labelled, blobs, TWO)[1]["to_classify"].tolist() == [True, True]


@pytest.mark.parametrize(("rules", "reported"), [(KITTI_RULES, False), (counting("dontcare"), True)])
def test_dontcare_regions(rules, reported):
    region = Regions(np.array([[490.0, 0.0, 510.0, 360.0]]), AHEAD_CAMERA)
    nothing = FrameTruth.of(KITTI_TYPES, [], [], [], regions=region)
    _, proposals = judged(nothing, [(blob(30, 20), 0), (blob(30, 20, 5), 1)], TWO, rules)
    assert proposals["to_report"].tolist() == [reported, True]


@pytest.mark.parametrize(
    ("types", "name", "judgement", "of_proposal", "owner"),
    [
        (KITTI_TYPES, "Van", (True, True, True), (True, True, True), CAR),
        (PAPER_TYPES, "Van", (False, False, False), (False, False, False), CAR),
        (PANDASET_TYPES, "Bus", (True, False, True), (False, True, False), CAR),
        (KITTI_TYPES, "Tram", (True, False, False), (True, True, True), BACKGROUND),
    ],
)
def test_roles_of_labelled_types(types, name, judgement, of_proposal, owner):
    truth = FrameTruth.of(types, [0], [name], [car(10.0)])
    objects, proposals = judged(truth, [(blob(30, 10), 0)], rules=CUBOID_RULES)
    assert objects[OBJECT].tolist() == [judgement]
    assert proposals[PROPOSAL].tolist() == [of_proposal]
    assert proposals["box_class"][0] == owner


@pytest.mark.parametrize(("rules", "counts"), [(CUBOID_RULES, False), (KITTI_RULES, True)])
def test_range(rules, counts):
    objects, proposals = judged(cars(70.0), [(blob(30, 70), 0)], rules=rules)
    assert (objects["to_follow"][0], proposals["to_report"][0]) == (counts, counts)


def test_frames_without_objects_or_proposals():
    objects, proposals = judged(FrameTruth.of(KITTI_TYPES, [], [], []), [], [])
    assert (len(objects), len(proposals)) == (0, 0)
    objects, proposals, associations, _ = judge(frame(cars(10.0), [(blob(30, 10), NONE)], []), KITTI_RULES)
    assert (objects["outcome"][0], objects["track"][0], len(proposals)) == (Outcome.MISSED, NONE, 0)
    assert associations[0].similarity.shape == (1, 0)


def test_associations_compare_by_the_points_in_common():
    blobs = [(blob(30, 10), 0), (blob(10, 10), NONE), (blob(20, 10, 5), 0)]
    first, second, *_ = judge(frame(cars(10.0, first_id=5), blobs, ONE), KITTI_RULES).associations
    assert (first.truth.tolist(), first.track.tolist(), first.similarity.tolist()) == ([5], [7], [[0.5]])
    assert not len(second.truth)


@given(st.integers(0, 2**32 - 1), st.integers(1, 6), st.booleans())
def test_points_of_objects_are_those_inside(seed, n, tilted):
    rng = np.random.default_rng(seed)
    points = np.c_[rng.uniform(-150, 150, (3000, 2)), rng.uniform(-2, 2, 3000), np.zeros(3000)].astype(np.float32)
    points[:2500, :2] /= 10
    T = se3(rotation_zyx(0.03, -0.02, 1.0), np.array([5.0, -3, 1])) if tilted else np.eye(4)
    place = transform(T, np.c_[rng.uniform(-15, 15, (n, 2)), rng.uniform(-1, 1, n)])
    boxes = np.c_[
        place, rng.uniform(0.5, 12, n), rng.uniform(0.5, 3, n), rng.uniform(0.5, 4, n), rng.uniform(-9, 9, n)
    ]
    truth = FrameTruth.of(KITTI_TYPES, range(n), ["Car"] * n, boxes, T_box_sensor=T)
    proposal = rng.integers(-1, 5, len(points))
    overlap = Overlap.of(dataclasses.replace(frame(truth, [], []), points=points, proposal=proposal))
    world = transform(T, points[:, :3].astype(np.float64)) if tilted else points
    for i, box in enumerate(boxes):
        clear = np.flatnonzero(inside(world, box))
        assert sorted(overlap.clear[i].tolist()) == clear.tolist()
        whole = inside(world, box, foot_m=-0.15)
        assert overlap.held[i].tolist() == [*np.bincount(proposal[whole] + 1, minlength=6)[1:], 0]
