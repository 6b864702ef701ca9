"""Labels of proposals."""

import numpy as np

from modt.classes import ObjectClass
from modt.types import NONE, Proposals
from tests.tools.train.datasets import scan_of
from tools.train.build_crops import label

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
    assert labels.owner.tolist() == [ObjectClass.CAR, 0, ObjectClass.CYCLIST, ObjectClass.CYCLIST]
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
