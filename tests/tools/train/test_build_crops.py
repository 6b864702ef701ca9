"""Labels of proposals, and objects pasted into other scans."""

import numpy as np
import pytest

from modt.classes import ObjectClass
from modt.types import NONE, Proposals
from modt_training.crop_writer import label
from tests.tools.train.datasets import scan_of
from tools.train.paste import ObjectCut, paste_objects

POINTS = np.zeros((40, 4), np.float32)


def proposals_of(*offsets: int) -> Proposals:
    """Proposals of consecutive points."""
    n = len(offsets) - 1
    none = np.zeros(n, np.bool_)
    return Proposals(np.arange(40), np.array(offsets), POINTS[:, :3].T, np.zeros((n, 3)), np.zeros((n, 7)), none)


def test_a_proposal_takes_the_class_of_the_object_it_overlaps_by_more_than_half():
    car = np.arange(0, 9)  # nearly the first proposal
    walker = np.arange(10, 14)  # too few points to count
    rider = np.arange(17, 40)  # three points of the second, all of the third and of the fourth: neither is whole
    unlabelled = np.zeros(40, np.bool_)
    kinds = [ObjectClass.CAR, ObjectClass.PEDESTRIAN, ObjectClass.CYCLIST]
    labels = label(scan_of(POINTS, [car, walker, rider], kinds, unlabelled), proposals_of(0, 10, 20, 30, 40))
    assert labels.kind.tolist() == [ObjectClass.CAR, 0, 0, 0]
    assert labels.partial.tolist() == [False, True, True, True]
    assert labels.unknown.tolist() == [True, False, False, False]  # nine points are too few to be judged by
    assert labels.majority.tolist() == [ObjectClass.CAR, 0, ObjectClass.CYCLIST, ObjectClass.CYCLIST]
    assert labels.whole.tolist() == [0, NONE, NONE]


def test_unlabelled_proposals_are_unknown():
    unlabelled = np.isin(np.arange(40), [0, 1, 10, 11, 12]) | (np.arange(40) >= 20)  # 2, 3 and 10 of ten points
    labels = label(scan_of(POINTS, [], [], unlabelled), proposals_of(0, 10, 20, 30, 40))
    assert labels.unknown.tolist() == [False, True, True, True]


def test_detectable_objects_are_known_outside_the_annotated_region():
    unlabelled = np.tile(np.arange(20) >= 5, 2)  # of both, most lies there
    labels = label(scan_of(POINTS, [np.arange(20)], [ObjectClass.CAR], unlabelled), proposals_of(0, 20, 40))
    assert labels.kind.tolist() == [ObjectClass.CAR, 0]
    assert labels.unknown.tolist() == [False, True]


def test_a_pasted_object_stands_on_the_ground_and_occludes_the_scene(rng):
    azimuth, elevation = np.meshgrid(np.arange(-180, 180, 0.4), np.arange(-24, -1, 0.8))
    rho = 1.7 / np.tan(np.deg2rad(-elevation.ravel()))
    a = np.deg2rad(azimuth.ravel())
    ground = np.c_[rho * np.cos(a), rho * np.sin(a), np.full(len(a), -1.7), np.zeros(len(a))].astype(np.float32)
    body = np.c_[np.full(60, 12.0), rng.uniform(-0.3, 0.3, 60), rng.uniform(-1.6, 0, 60), np.zeros(60)]
    box = np.array([12.0, 0, -1.7, 0.8, 0.8, 1.8, 0])
    cuts = [ObjectCut(body.astype(np.float32), box, kind, "there") for kind in list(ObjectClass)[1:]]
    empty = scan_of(ground, [], [], np.zeros(len(ground), np.bool_))
    made = list(paste_objects(empty, cuts, 8, rng))
    assert made
    scan = made[0]
    assert scan.drive == "there"
    assert len(scan.points) < len(ground) + sum(map(len, scan.objects))
    for own, box in zip(scan.objects, scan.boxes, strict=True):
        assert np.hypot(*scan.points[own, :2].T) == pytest.approx(np.hypot(*box[:2]), abs=1.0)
        assert not scan.unlabelled[own].any()
    assert scan.unlabelled.sum() == len(scan.points) - sum(map(len, scan.objects))
