"""Proposals of two sensors: what both see is one object."""

import numpy as np
import pytest

from modt.segmentation.joining import SensorProposals, join
from modt.segmentation.kernels import NUMPY
from modt.types import Cut, PointKind, Proposals

SR = 1e-4


def box_of(xyz):
    low = xyz.min(axis=1)
    high = xyz.max(axis=1)
    return [*((low + high) / 2), *np.sort(high[:2] - low[:2])[::-1], high[2] - low[2], 0.0]


def seen(*parts, cut=0, extra=3):
    """View of a sensor: point sets (3, n), and some points of the ground after them."""
    count = np.array([part.shape[1] for part in parts], np.int64)
    xyz = np.concatenate([*parts, np.zeros((3, 0))], axis=1).astype(np.float32)
    n = xyz.shape[1]
    kind = np.full(n + extra, PointKind.GROUND, np.int8)
    kind[:n] = PointKind.MEMBER
    proposals = Proposals(
        members=np.arange(n),
        offsets=np.concatenate([[0], count.cumsum()]),
        coordinates=xyz,
        centroid=np.array([part.mean(axis=1) for part in parts]).reshape(-1, 3),
        box=np.array([box_of(part) for part in parts]).reshape(-1, 7),
        cut=np.full(len(parts), cut),
        ground_z_m=np.full(len(parts), -0.6),
        kind=kind,
        feet=np.zeros((2, 0), np.int64),
    )
    return SensorProposals(proposals, np.full(len(parts), SR), n + extra)


def column(x, y, *, z=(0.0, 1.0), n=40, radius=0.2, seed=0):
    """(3, n) points on an upright column."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0, 2 * np.pi, n)
    return np.stack([x + radius * np.cos(angle), y + radius * np.sin(angle), rng.uniform(*z, n)])


def plate(x, y, length, *, n=120, seed=1):
    """(3, n) points on an upright plate along x, 2 m high."""
    rng = np.random.default_rng(seed)
    return np.stack([x + rng.uniform(0, length, n), np.full(n, y), rng.uniform(-0.5, 1.5, n)])


def test_an_object_that_both_see_is_one_proposal_of_all_its_points():
    both = join([seen(column(5, 0)), seen(column(5, 0, seed=7, n=24), column(5, 9))], NUMPY)
    assert both.count.tolist() == [64, 40]
    assert both.members[:64].tolist() == [*range(40), *range(43, 67)]
    assert both.kind[both.members].tolist() == [PointKind.MEMBER] * 104
    assert both.box[0, :2] == pytest.approx([5, 0], abs=0.05)
    assert both.centroid[0] == pytest.approx(both.coordinates[:, :64].mean(axis=1), abs=1e-5)
    assert not both.box.flags.writeable


def test_its_points_cover_the_area_that_each_sensor_saw_once():
    both = join([seen(column(5, 0)), seen(column(5, 0, seed=7))], NUMPY)
    assert both.beam_sr == pytest.approx(SR / 2, rel=0.05)  # twice the points, as of a finer sensor


def test_halves_that_two_sensors_see_from_two_sides_are_one():
    points = column(4, 0, n=200)
    halves = [points[:, points[1] >= 0], points[:, points[1] < 0]]
    assert len(join([seen(half) for half in halves], NUMPY)) == 1


def test_what_both_keep_apart_stays_apart():
    """A person 0.1 m beside a wall."""
    views = [seen(column(5, 0.3, seed=k), plate(4, 0, 3, seed=10 + k)) for k in range(2)]
    both = join(views, NUMPY)
    assert both.count.tolist() == [80, 240]


def test_parts_of_one_sensor_are_joined_where_the_other_sees_the_whole():
    parts = plate(4, 0, 1.2), plate(6, 0, 1.2, seed=3)
    both = join([seen(*parts), seen(plate(4, 0, 3.2, seed=5))], NUMPY)
    assert both.count.tolist() == [360]
    assert both.box[0, 3] == pytest.approx(3.2, abs=0.1)


def test_what_lies_above_another_thing_is_not_joined_with_it():
    both = join([seen(column(5, 0, z=(0.0, 0.5))), seen(column(5, 0, z=(1.5, 2.0)))], NUMPY)
    assert len(both) == 2


def test_an_end_that_one_sensor_sees_is_no_end_of_the_view():
    below = seen(column(5, 0, z=(0.0, 0.8)), cut=Cut.TOP.value)
    assert join([below, seen(column(5, 0, z=(0.0, 1.7), seed=2))], NUMPY).cut.tolist() == [0]
    assert join([below, below], NUMPY).cut.tolist() == [Cut.TOP.value]


@pytest.mark.parametrize("views", [[], [seen()], [seen(), seen()]], ids=["no sensor", "one", "two"])
def test_nothing_seen_is_no_proposal(views):
    both = join(views, NUMPY)
    assert len(both) == 0
    assert len(both.kind) == 3 * len(views)


def test_one_sensor_alone_keeps_its_proposals():
    alone = seen(column(5, 0), column(8, 2))
    both = join([alone], NUMPY)
    for name in ("members", "offsets", "box", "centroid", "cut", "kind"):
        np.testing.assert_array_equal(getattr(both, name), getattr(alone.proposals, name))
