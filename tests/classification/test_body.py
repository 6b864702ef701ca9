"""The body of a person in a proposal that shows more."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from modt.classes import ObjectClass
from modt.classification.body import bodies, may_hold_more
from modt.classification.crops import Crops
from modt.classification.tuning import BodyTuning
from modt.types import Proposals
from tests.classification.scenes import classifier

TUNING = BodyTuning()


def crops_of(clouds):
    return Crops(np.concatenate(clouds).astype(np.float32), np.append(0, np.cumsum([len(cloud) for cloud in clouds])))


def upright(x, y, n=60, radius_m=0.2, top_m=1.7):
    """Points of something round and upright."""
    angle = np.linspace(0, 2 * np.pi, n)
    return np.column_stack([x + radius_m * np.cos(angle), y + radius_m * np.sin(angle), np.linspace(0.25, top_m, n)])


def body_by_hand(xyz, ground_m, tuning):
    """Points of one body, None if it shows too little: slow and obvious."""
    height_m = xyz[:, 2] - ground_m
    legs = xyz[(height_m > tuning.min_leg_m) & (height_m < tuning.max_leg_m)]
    if not len(legs):
        return None
    middle = [sorted(legs[:, axis])[len(legs) // 2] for axis in (0, 1)]
    aside_m = np.hypot(*(xyz[:, :2].astype(float) - middle).T)
    inside = (aside_m**2 < tuning.radius_m**2) & (height_m < tuning.top_m)
    if inside.sum() < max(tuning.min_points, tuning.min_share * len(xyz)):
        return None
    return xyz[inside] if np.ptp(height_m[inside]) > tuning.min_height_m else None


@given(st.integers(0, 10_000))
def test_bodies_are_those_found_one_by_one(seed):
    rng = np.random.default_rng(seed)
    clouds = [
        np.concatenate([upright(*rng.uniform(-9, 9, 2), n=int(rng.integers(2, 60))), rng.uniform(-9, 9, (k, 3))])
        for k in rng.integers(0, 80, 7)
    ]
    crops = crops_of(clouds)
    ground_m = rng.normal(0, 0.2, len(crops))
    rows = np.flatnonzero(rng.random(len(crops)) < 0.8)
    shown, found = bodies(crops, ground_m, rows, TUNING)
    each = {
        row: body_by_hand(crops.xyz[crops.offsets[row] : crops.offsets[row + 1]], ground_m[row], TUNING)
        for row in rows
    }
    assert shown.tolist() == [row for row, body in each.items() if body is not None]
    assert len(found) == len(shown)
    for k, row in enumerate(shown):
        assert_array_equal(found.xyz[found.offsets[k] : found.offsets[k + 1]], each[row])


def with_a_plank():
    plank = np.column_stack([np.linspace(3.8, 6.2, 50), np.full(50, 1.3), np.full(50, 1.45)])
    return np.concatenate([upright(5.0, 1.0), plank])


def test_a_plank_on_the_shoulder_is_no_part_of_the_body():
    person = upright(5.0, 1.0)
    shown, found = bodies(crops_of([with_a_plank()]), np.zeros(1), np.arange(1), TUNING)
    assert shown.tolist() == [0]
    assert len(found.xyz) < len(person) + 10
    assert np.ptp(found.xyz[:, 0]) < 0.7


def test_what_is_no_larger_than_a_person_or_too_large_is_not_looked_at():
    sizes = {(0.6, 1.7): False, (2.4, 1.7): True, (0.6, 2.4): True, (4.0, 1.7): False, (0.6, 3.2): False}
    box = np.array([(5.0, 0.0, top / 2 + 0.5, length, 0.5, top, 0.0) for length, top in sizes])
    assert may_hold_more(box, np.full(len(box), 0.5), TUNING).tolist() == list(sizes.values())


class NarrowIsPerson:
    """A network that takes what is narrow for a person and everything else for background."""

    def __init__(self):
        self.calls = 0

    def infer(self, batch):
        self.calls += 1
        is_narrow = np.ptp(batch[:, :, :2], axis=1).max(axis=1) < 0.7
        return np.where(is_narrow[:, None], [0.05, 0.0, 0.95, 0.0], [0.95, 0.0, 0.05, 0.0])


def proposals_of(clouds):
    """Proposals of clouds on ground of z = 0, with their boxes along the axes."""
    crops = crops_of(clouds)
    low, high = (np.stack([bound(cloud, axis=0) for cloud in clouds]) for bound in (np.min, np.max))
    box = np.column_stack([(low + high) / 2, high - low, np.zeros(len(clouds))])
    none = np.zeros(len(clouds), np.int64)
    n = len(crops.xyz)
    return Proposals(
        np.arange(n), crops.offsets, crops.xyz.T, box[:, :3], box, none, ground_z_m=np.zeros(len(clouds))
    )


def test_a_person_with_a_load_is_classified_by_the_body_alone():
    net = classifier()
    bush = np.random.default_rng(0).uniform([4, -4, 0.25], [6, -2, 1.6], (200, 3))
    proposals = proposals_of([with_a_plank(), upright(8.0, 0.0), bush])
    which = np.arange(3)
    net.network = NarrowIsPerson()
    net._near = None
    called = net.classify(np.zeros((0, 4), np.float32), proposals, which)[:, ObjectClass.PEDESTRIAN]
    assert (called > 0.5).tolist() == [True, True, False]
    assert net.network.calls > 1


def test_a_model_without_classifiers_of_boxes_sees_each_proposal_once():
    net = classifier(likelihood="network")
    net.network = NarrowIsPerson()
    called = net.classify(np.zeros((0, 4), np.float32), proposals_of([with_a_plank()]), np.arange(1))
    assert called[0, ObjectClass.BACKGROUND] > 0.9
    assert net.network.calls == 1
