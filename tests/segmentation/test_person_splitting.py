import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modt.config import SegmentationConfig, SensorConfig
from modt.geometry import FieldOfView
from modt.segmentation.clusters import Clusters
from modt.segmentation.person_splitting import PersonSplitter
from modt.segmentation.point_columns import PointColumns
from modt.segmentation.segmenter import Segmenter
from tests.segmentation import reference, scans

STEP_DEG = 0.17
PERSON = (0.35, 0.5, 0.0, 1.75)
CAR = (4.2, 1.8, 0.2, 1.5)


def split(points, group, candidate=None):
    """(K,) cluster of each point after splitting, and their number; each point is a cell."""
    cloud, cell = PointColumns.from_array(points), np.arange(len(points))
    n = int(group.max()) + 1
    clusters = Clusters(cloud, points[:, 2], cell, None, cell, group, n)
    candidate = np.ones(n, np.bool_) if candidate is None else candidate
    sensor, count = SensorConfig(), np.bincount(group)
    middle = (np.bincount(group, points[:, k]) / count for k in (0, 1))
    beam_m = np.hypot(*middle) * np.deg2rad(sensor.elevation_step_deg)
    return PersonSplitter(sensor, SegmentationConfig()).split(clusters, candidate, beam_m)


def crowd(rng, n):
    """Points of up to four things side by side, people or not, in groups about the sensor, and their groups."""
    points, group = [], []
    for i in range(n):
        bearing, away = rng.uniform(-np.pi, np.pi), rng.uniform(5.0, 40.0)
        aside = 0.0
        for _ in range(rng.integers(1, 5)):
            breadth, tall = rng.uniform(0.1, 0.9), rng.uniform(0.8, 2.4)
            k = rng.integers(1, 250)
            along = away + rng.uniform(-0.5, 0.5) + rng.uniform(0, rng.choice([0.3, 1.5]), k)
            across = aside + rng.uniform(0, breadth, k)
            c, s = np.cos(bearing), np.sin(bearing)
            points.append(
                np.stack([along * c - across * s, along * s + across * c, rng.uniform(0.25, tall, k)], axis=1)
            )
            group.append(np.full(k, i))
            aside += breadth + rng.uniform(0.0, 0.4)
    order = rng.permutation(sum(len(p) for p in points))
    return np.concatenate(points)[order].astype(np.float32), np.concatenate(group)[order]


@given(seed=st.integers(0, 10_000), n=st.integers(1, 6))
@settings(max_examples=60)
def test_splits_equal_those_of_each_cluster_alone(seed, n):
    points, group = crowd(np.random.default_rng(seed), n)
    cloud = PointColumns.from_array(points)
    fast, clusters = split(points, group)
    total = 0
    for i in range(n):
        own = np.flatnonzero(group == i)
        column, boundaries = reference.person_boundaries(
            cloud.x[own], cloud.y[own], points[own, 2], SensorConfig(), SegmentationConfig().person_splitting
        )
        total += len(boundaries)
        assert reference.same_partition(fast[own], np.searchsorted(boundaries, column, side="right"))
    assert clusters == n + total
    assert len(np.unique(fast)) == clusters


def test_random_crowds_are_split():
    """The comparison above covers clusters that are split."""
    cut = 0
    for seed in range(10):
        points, group = crowd(np.random.default_rng(seed), 6)
        cut += split(points, group)[1] - 6
    assert cut > 10


def test_without_candidates_nothing_changes():
    points, group = crowd(np.random.default_rng(3), 4)
    new, n = split(points, group, np.zeros(4, np.bool_))
    assert n == 4
    assert np.array_equal(new, group)


def owners(boxes, step_deg=STEP_DEG, seed=0, split=True):
    """Points of each proposal of a scene by the box that they lie on."""
    points, on = scans.scan(boxes, step_deg=step_deg, azimuth_deg=(-40, 40), seed=seed)
    stage = Segmenter(SegmentationConfig(), SensorConfig(azimuth_step_deg=step_deg), FieldOfView())
    if not split:
        stage.clusterer.splitter.candidates = lambda sizes: np.zeros(len(sizes), np.bool_)
    found = stage.segment(points)
    ends = zip(found.offsets, found.offsets[1:], strict=False)
    return [np.bincount(on[found.members[a:b]], minlength=len(boxes) + 1)[1:] for a, b in ends]


@pytest.mark.parametrize(("range_m", "gap_m"), [(8.0, 0.2), (12.0, 0.22), (16.0, 0.24), (22.0, 0.28)])
def test_two_people_close_together_are_two(range_m, gap_m):
    for seed, aside in enumerate(np.linspace(-1.0, 1.0, 12)):
        pair = [(range_m, aside, *PERSON), (range_m, aside + 0.5 + gap_m, *PERSON)]
        found = owners(pair, seed=seed)
        assert len(found) == 2
        assert all(min(own) == 0 for own in found)


def test_two_people_holding_hands_are_two():
    pair = [(10.0, 0.0, *PERSON), (10.0, 0.7, *PERSON), (10.0, 0.35, 0.08, 0.3, 0.8, 0.9)]
    assert len(owners(pair, split=False)) == 1
    found = owners(pair)
    assert len(found) == 2
    assert all(min(own[:2]) == 0 for own in found)


def test_a_person_in_front_of_a_bush_is_split_from_it():
    found = owners([(12.0, 0.0, *PERSON), (12.75, 0.9, 0.6, 1.4, 0.0, 1.6)])
    assert len(found) == 2
    mine = max(found, key=lambda own: own[0])
    assert mine[1] == 0
    assert mine[0] > 100


@pytest.mark.parametrize(
    "thing",
    [
        (12.0, 0.0, *CAR),
        (25.0, 2.0, *CAR),
        (38.0, -3.0, *CAR),
        (10.0, 0.0, 1.0, 2.4, 0.0, 1.7),  # a hedge
        (8.0, 1.0, 0.15, 0.15, 0.0, 2.4),  # a pole
        (14.0, 0.0, 0.4, 1.7, 0.0, 1.6),  # a cyclist from the side
        (9.0, 0.0, *PERSON),
    ],
)
def test_one_object_is_not_split(thing):
    for seed in range(4):
        x, y, *rest = thing
        moved = [(x, y + 0.03 * seed, *rest)]
        assert len(owners(moved, seed=seed)) == len(owners(moved, seed=seed, split=False))


def test_empty_columns_of_a_coarse_sensor_are_no_gap():
    for seed in range(8):
        assert len(owners([(20.0, 0.02 * seed, 0.4, 1.2, 0.0, 1.7)], step_deg=0.35, seed=seed)) == 1


def test_a_cluster_around_the_sensor_is_not_split():
    turn = np.linspace(0, 2 * np.pi, 600, endpoint=False)
    points = np.stack([1.2 * np.cos(turn), 1.2 * np.sin(turn), np.tile([-0.9, -0.3, 0.0], 200)], axis=1)
    stage = Segmenter(SegmentationConfig(), SensorConfig(min_range_m=0.2), FieldOfView())
    assert len(stage.segment(points.astype(np.float32))) == 1
