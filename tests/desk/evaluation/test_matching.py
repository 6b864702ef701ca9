import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.classes import ObjectClass
from modt.geometry import Camera, FieldOfView, rotation_zyx, se3, transform
from modt.types import NONE
from modt_desk.evaluation.matching import judge
from modt_desk.evaluation.overlap import Overlap, inside
from modt_desk.evaluation.rows import Outcome
from modt_desk.evaluation.rules import CUBOID_RULES, KITTI_RULES
from modt_desk.evaluation.truth import KITTI_TYPES, PANDASET_TYPES, PAPER_TYPES, FrameTruth, Regions
from tests.desk.evaluation.scenes import blob, car, cars, frame

CAR, BACKGROUND = ObjectClass.CAR, ObjectClass.BACKGROUND
AHEAD_CAMERA = Camera(np.array([[500.0, -700, 0, 0], [180, 0, -700, 0], [1, 0, 0, 0]]), np.eye(4), 1000.0, 360.0)


def counting(*what):
    return dataclasses.replace(KITTI_RULES, ignored=KITTI_RULES.ignored - set(what))


@pytest.mark.parametrize(
    ("blobs", "outcome"),
    [
        ([(blob(40, 10), 0)], Outcome.DETECTED),
        ([(blob(40, 10), 0), (blob(50, 10, 5), 0)], Outcome.MERGED),
        ([(blob(19, 10), 0), (blob(19, 9.8), 1), (blob(2, 10), NONE)], Outcome.SPLIT),
        ([(blob(28, 10), 0), (blob(12, 10), NONE), (blob(27, 10, 5), 0)], Outcome.PARTIAL),
        ([(blob(15, 10), 0), (blob(25, 10), NONE)], Outcome.MISSED),
        ([(blob(40, 10), NONE)], Outcome.MISSED),
    ],
)
def test_outcomes_of_segmentation(blobs, outcome):
    objects, _, _ = judge(frame(cars(10.0), blobs, []), KITTI_RULES)
    assert objects["to_segment"].all()
    assert objects["outcome"].tolist() == [outcome]


def test_points_near_the_ground_are_of_the_box_but_not_of_the_object():
    low = blob(30, 10)
    low[:, 2] = -1.6  # 0.1 m above the foot
    objects, proposals, _ = judge(
        frame(cars(10.0), [(blob(40, 10), 0), (low, 1)], [(7, 0, "car"), (8, 1, "car")]), KITTI_RULES
    )
    assert objects["outcome"].tolist() == [Outcome.DETECTED]
    assert proposals["label"].tolist() == [CAR, BACKGROUND]
    assert proposals["owner"].tolist() == [CAR, CAR]


def test_half_of_each_other_or_iou():
    scene = frame(cars(10.0), [(blob(28, 10), 0), (blob(12, 10), NONE), (blob(27, 10, 5), 0)], [(7, 0, "car")])
    assert judge(scene, KITTI_RULES)[1]["label"].tolist() == [CAR]
    assert judge(scene, CUBOID_RULES)[1]["label"].tolist() == [BACKGROUND]


def test_objects_of_few_points():
    scene = frame(cars(10.0), [(blob(9, 10), 0)], [(7, 0, "car")])
    objects, proposals, _ = judge(scene, KITTI_RULES)
    assert not objects[["to_segment", "to_classify", "to_follow"]].tolist()[0][0]
    assert not proposals["to_classify"][0]
    assert judge(scene, counting("few"))[1]["to_classify"][0]
    between = judge(frame(cars(10.0), [(blob(15, 10), 0)], [(7, 0, "car")]), KITTI_RULES)[0]
    assert (between["to_segment"][0], between["to_follow"][0]) == (False, True)


def test_objects_cut_by_the_view():
    left = FieldOfView(np.array([[0.0, 1.0, 0.0, 0.0]]))
    blobs = [(blob(30, 10, -0.4), 0), (blob(20, 10, 0.4), 0)]
    scene = frame(cars(10.0), blobs, [(7, 0, "car")], fov=left)
    objects, proposals, _ = judge(scene, KITTI_RULES)
    judged = ["in_view", "to_segment", "to_classify", "to_follow"]
    assert objects[judged].tolist() == [(False, False, False, True)]
    assert not proposals["to_classify"][0]
    counted, rows, _ = judge(scene, counting("cut"))
    assert counted[judged].tolist() == [(False, True, True, True)]
    assert rows["label"][0] == CAR


def test_beyond_the_labelled_sector_nothing_is_judged_but_life():
    truth = FrameTruth.of(KITTI_TYPES, [0], ["Car"], [car(1.0, 10.0)])
    objects, proposals, _ = judge(frame(truth, [(blob(30, 1, 10), 0)], [(7, 0, "car")]), KITTI_RULES)
    assert objects[["to_segment", "to_classify", "to_follow"]].tolist() == [(True, False, True)]
    assert not proposals["to_report"][0]


def test_parked_cars_outside_their_labels():
    nothing = FrameTruth.of(KITTI_TYPES, [], [], [], parked=np.array([car(10.0)]))
    scene = frame(nothing, [(blob(30, 10), 0), (blob(30, 30), 1)], [(7, 0, "car"), (8, 1, "car")])
    for column in ("to_classify", "to_report", "to_associate"):
        assert judge(scene, KITTI_RULES)[1][column].tolist() == [False, True]
        assert judge(scene, counting("parked"))[1][column].tolist() == [True, True]
    labelled = dataclasses.replace(scene, truth=dataclasses.replace(cars(10.0), parked=nothing.parked))
    assert judge(labelled, KITTI_RULES)[1]["to_classify"].tolist() == [True, True]


def test_dontcare_regions():
    region = Regions(np.array([[490.0, 0.0, 510.0, 360.0]]), AHEAD_CAMERA)
    nothing = FrameTruth.of(KITTI_TYPES, [], [], [], regions=region)
    scene = frame(nothing, [(blob(30, 20), 0), (blob(30, 20, 5), 1)], [(7, 0, "car"), (8, 1, "car")])
    assert judge(scene, KITTI_RULES)[1]["to_report"].tolist() == [False, True]
    assert judge(scene, counting("dontcare"))[1]["to_report"].tolist() == [True, True]


def test_roles_of_labelled_types():
    blobs, tracks = [(blob(30, 10), 0)], [(7, 0, "car")]

    def rows(types, name):
        return judge(frame(FrameTruth.of(types, [0], [name], [car(10.0)]), blobs, tracks), CUBOID_RULES)[:2]

    van, of_van = rows(KITTI_TYPES, "Van")
    assert van["to_classify"][0]
    assert of_van["label"][0] == CAR
    van, of_van = rows(PAPER_TYPES, "Van")
    assert not van[["to_segment", "to_classify", "to_follow"]].tolist()[0][0]
    assert of_van[["to_classify", "to_report", "to_associate"]].tolist() == [(False, False, False)]
    bus, of_bus = rows(PANDASET_TYPES, "Bus")
    assert bus[["to_segment", "to_classify", "to_follow"]].tolist() == [(True, False, True)]
    assert (of_bus["to_classify"][0], of_bus["to_report"][0], of_bus["owner"][0]) == (False, True, CAR)
    tram, of_tram = rows(KITTI_TYPES, "Tram")
    assert tram[["to_segment", "to_classify", "to_follow"]].tolist() == [(True, False, False)]
    assert (of_tram["to_classify"][0], of_tram["to_report"][0], of_tram["owner"][0]) == (True, True, BACKGROUND)


def test_range():
    far = frame(cars(70.0), [(blob(30, 70), 0)], [(7, 0, "car")])
    assert not judge(far, CUBOID_RULES)[0]["to_follow"][0]
    assert not judge(far, CUBOID_RULES)[1]["to_report"][0]
    assert judge(far, KITTI_RULES)[0]["to_follow"][0]


def test_frames_without_objects_or_proposals():
    nothing = FrameTruth.of(KITTI_TYPES, [], [], [])
    objects, proposals, _ = judge(frame(nothing, [], []), KITTI_RULES)
    assert (len(objects), len(proposals)) == (0, 0)
    objects, proposals, associations = judge(frame(cars(10.0), [(blob(30, 10), NONE)], []), KITTI_RULES)
    assert (objects["outcome"][0], objects["track"][0], len(proposals)) == (Outcome.MISSED, NONE, 0)
    assert associations[0].similarity.shape == (1, 0)


def test_associations_compare_by_the_points_in_common():
    blobs = [(blob(30, 10), 0), (blob(10, 10), NONE), (blob(20, 10, 5), 0)]
    _, _, associations = judge(frame(cars(10.0, first_id=5), blobs, [(7, 0, "car")]), KITTI_RULES)
    assert (associations[0].truth.tolist(), associations[0].track.tolist()) == ([5], [7])
    assert associations[0].similarity.tolist() == [[0.5]]
    assert not len(associations[1].truth)


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
        assert sorted(overlap.own[i].tolist()) == clear.tolist()
        whole = inside(world, box, foot_m=-0.15)
        assert overlap.held[i].tolist() == [*np.bincount(proposal[whole] + 1, minlength=6)[1:], 0]
