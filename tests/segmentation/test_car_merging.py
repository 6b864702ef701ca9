import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modt.config import SegmentationConfig, SensorConfig
from modt.geometry import FieldOfView
from modt.segmentation.car_merging import RANGE, Bounds, Pieces
from modt.segmentation.columns import Columns
from modt.segmentation.groups import Groups
from modt.segmentation.segmenter import Segmenter
from tests.segmentation import reference, scans

BEAM = np.tan(np.deg2rad(SensorConfig().elevation_step_deg))
PERSON = (0.35, 0.5, 0.0, 1.75)


def strips(rng, n):
    """Bounds of n strips, some one above and behind the other, around the sensor."""
    points, low, high, group = [], [], [], []
    for i in range(n):
        if i % 3 == 0:
            bearing, away, bottom = rng.uniform(-np.pi, np.pi), rng.uniform(20.0, 70.0), rng.uniform(0.25, 0.9)
        else:
            away, bottom = away + rng.uniform(-0.2, 2.2), bottom + rng.uniform(-0.1, 0.8)
        k = rng.integers(2, 12)
        across = rng.uniform(-0.5, 0.5) + rng.uniform(0.0, rng.choice([0.5, 1.8, 5.0]), k)
        along = away + rng.uniform(0.0, rng.choice([0.2, 1.5]), k)
        c, s = np.cos(bearing), np.sin(bearing)
        points.append(np.stack([along * c - across * s, along * s + across * c, 0 * along], axis=1))
        low.append(np.full(k, bottom))
        high.append(bottom + rng.uniform(0.0, rng.choice([0.3, 1.5]), k))
        group.append(np.full(k, i))
    order = rng.permutation(sum(len(p) for p in points))
    cells = Columns.of(np.concatenate(points)[order].astype(np.float32))
    low, high = (np.concatenate(v)[order].astype(np.float32) for v in (low, high))
    ground = np.full(len(order), -1.73, np.float32)
    return Bounds.of(cells, ground, low, high, Groups.of(np.concatenate(group)[order], n))


@given(seed=st.integers(0, 10_000), n=st.integers(1, 24))
@settings(max_examples=80)
def test_pieces_are_joined_as_one_by_one(seed, n):
    bounds = strips(np.random.default_rng(seed), n)
    np.testing.assert_array_equal(Pieces(SensorConfig()).whole(bounds), reference.whole(bounds, BEAM))


def test_it_joins_something_somewhere():
    """Or the test above would compare nothing with nothing."""
    joined = chained = refused = 0
    for seed in range(60):
        bounds = strips(np.random.default_rng(seed), 24)
        stage = Pieces(SensorConfig())
        whole = stage.whole(bounds)
        joined += np.count_nonzero(whole != np.arange(24))
        chained += np.count_nonzero(np.bincount(whole, minlength=24) > 2)
        front, back = stage.pairs(bounds)
        refused += np.count_nonzero(whole[front] != whole[back])
    assert joined > 40
    assert chained > 5
    assert refused > 0


@given(bearing=st.floats(-1.4, 4.5), range_m=st.floats(20.0, 70.0), breadth_m=st.floats(0.3, 5.0))
def test_bounds_are_in_metres(bearing, range_m, breadth_m):
    angle = bearing + np.linspace(-0.5, 0.5, 9) * breadth_m / range_m
    cells = Columns.of((range_m * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)).astype(np.float32))
    low, high = np.linspace(0.3, 0.5, 9, dtype=np.float32), np.linspace(1.2, 1.0, 9, dtype=np.float32)
    bounds = Bounds.of(cells, np.full(9, -1.5, np.float32), low, high, Groups.of(np.zeros(9, np.int64), 1))
    assert bounds.breadth_m[0] == pytest.approx(breadth_m, rel=breadth_m / range_m, abs=0.02)
    assert bounds.least[1:, 0] == pytest.approx([range_m, 0.3, -1.2 / range_m], rel=1e-4)
    assert bounds.most[1:, 0] == pytest.approx([range_m, 1.2, -0.3 / range_m], rel=1e-4)


def owners(boxes, seed=0, joining=True):
    """Of each proposal of a scene, how many points it has of each box."""
    points, on = scans.scan(boxes, step_deg=0.17, azimuth_deg=(-40, 40), seed=seed)
    stage = Segmenter(SegmentationConfig(), SensorConfig(), FieldOfView())
    if not joining:
        stage.clusterer.pieces.range_m = np.inf
    found = stage.segment(points)
    ends = zip(found.offsets, found.offsets[1:], strict=False)
    return [np.bincount(on[found.members[a:b]], minlength=len(boxes) + 1)[1:] for a, b in ends]


def rear_and_roof(x, y):
    return [(x, y, 0.4, 1.7, 0.3, 0.9), (x + 2.2, y, 1.6, 1.5, 0.8, 1.5)]


@pytest.mark.parametrize(("x", "y"), [(28.0, 0.0), (34.0, -9.0), (40.0, 6.0)])
def test_rear_and_roof_are_one_car_at_every_moment(x, y):
    apart = 0
    for seed in range(6):
        car = rear_and_roof(x + 0.3 * seed, y)
        apart += all(min(own) == 0 for own in owners(car, seed, joining=False))
        found = owners(car, seed)
        largest = max(found, key=sum)
        assert min(largest) > 0
        assert sum(largest) > 0.9 * sum(map(sum, found))
    assert apart > 0


@pytest.mark.parametrize(
    "pair",
    [
        [(30.0, 0.0, 4.2, 1.8, 0.2, 1.2), (33.6, 0.2, *PERSON)],  # someone behind a car
        [(30.0, 0.0, 0.4, 0.4, 0.0, 1.1), (31.5, 0.2, *PERSON)],  # someone behind a bollard
        [(30.0, 0.0, *PERSON), (31.5, 0.3, *PERSON)],
        [(30.0, 0.0, 4.2, 1.8, 0.2, 1.4), (36.0, 0.0, 4.2, 1.8, 0.2, 1.9)],  # nose to tail, the second a van
        [(30.0, 0.0, 4.2, 1.8, 0.2, 1.2), (34.0, 0.0, 0.3, 12.0, 0.0, 2.5)],  # a car before a wall
        [(35.0, 0.0, 0.4, 1.7, 0.3, 0.9), (37.0, 2.5, 1.6, 1.5, 0.95, 1.5)],  # side by side
    ],
)
def test_two_things_stay_two(pair):
    for seed in range(4):
        moved = [(x, y + 0.05 * seed, *rest) for x, y, *rest in pair]
        assert all(min(own) == 0 for own in owners(moved, seed))


def test_what_is_near_is_left_alone():
    stage = Pieces(SensorConfig())
    size, points = np.ones(3, np.float32), np.full(3, 50.0)
    root = np.sqrt(np.array([10.0, 24.0, 27.0], np.float32))
    assert stage.possible(size, size, points, root).tolist() == [False, False, True]


def test_nothing_is_made_larger_than_an_object_may_be():
    larger = 0
    for seed in range(20):
        bounds = strips(np.random.default_rng(seed), 24)
        for limit_m in (2.0, 6.0):
            whole = Pieces(SensorConfig(), limit_m).whole(bounds)
            joined = [np.flatnonzero(whole == first) for first in np.unique(whole) if np.sum(whole == first) > 1]
            for own in joined:
                together = bounds.take(own).over(Groups(np.arange(len(own)), np.array([0, len(own)])))
                depth = together.most[RANGE] - together.least[RANGE]
                diagonal_m = float(np.hypot(together.breadth_m, depth)[0])
                assert diagonal_m < limit_m
                larger += diagonal_m > 2.0
    assert larger > 5  # than the lower of the limits, where the other holds
