import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.geometry import upright_boxes
from modt.segmentation.groups import HEADINGS, Groups, best_headings
from modt.segmentation.segmenter import SIDE_NOISE_M
from tests.segmentation import reference


def groups_of(sizes):
    return Groups.from_labels(np.repeat(np.arange(len(sizes)), sizes), len(sizes))


def slow_upright_box(xyz, yaw):
    """(7,) box of one cluster of (3, n) points."""
    c, s = np.cos(yaw), np.sin(yaw)
    sides = np.stack([xyz[0] * c + xyz[1] * s, xyz[1] * c - xyz[0] * s, xyz[2]])
    low, high = sides.min(axis=1), sides.max(axis=1)
    (u, v, w), (length, width, height) = (low + high) / 2, high - low
    if length < width:
        length, width, yaw = width, length, yaw - np.pi / 2
    return np.array([u * c - v * s, u * s + v * c, w, length, width, height, yaw])


def l_shape(length, width, yaw, centre, n=60):
    """The two sides of a car that face the sensor."""
    t = np.linspace(-0.5, 0.5, n)
    local = np.concatenate(
        [np.stack([t * length, np.full(n, -width / 2)], 1), np.stack([np.full(n, -length / 2), t * width], 1)]
    )
    c, s = np.cos(yaw), np.sin(yaw)
    return local @ np.array([[c, s], [-s, c]]) + centre


@given(seed=st.integers(0, 10_000), sizes=st.lists(st.integers(1, 40), min_size=1, max_size=6))
def test_headings_equal_those_of_each_cluster_alone(seed, sizes):
    x, y = np.random.default_rng(seed).normal(0, 2, (2, sum(sizes))).astype(np.float32)
    groups = groups_of(sizes)
    found = HEADINGS[best_headings(x, y, groups, 1000, SIDE_NOISE_M)]
    for i, (start, end) in enumerate(zip(groups.offsets[:-1], groups.offsets[1:], strict=True)):
        closeness = reference.closeness(x[start:end].astype(float), y[start:end].astype(float), SIDE_NOISE_M)
        chosen = np.argmin(np.abs(HEADINGS - found[i]))
        assert closeness[chosen] >= closeness.max() * 0.999


@given(seed=st.integers(0, 10_000), sizes=st.lists(st.integers(1, 40), min_size=1, max_size=6))
def test_boxes_equal_those_of_each_cluster_alone(seed, sizes):
    rng = np.random.default_rng(seed)
    (x, y, z), yaw = rng.normal(0, 2, (3, sum(sizes))).astype(np.float32), rng.uniform(-3, 3, len(sizes))
    groups = groups_of(sizes)
    many = upright_boxes(np.stack([x, y, z]), groups.offsets, yaw)
    for i, (start, end) in enumerate(zip(groups.offsets[:-1], groups.offsets[1:], strict=True)):
        one = slow_upright_box(np.stack([x, y, z])[:, start:end].astype(np.float64), yaw[i])
        np.testing.assert_allclose(many[i], one, atol=1e-4)


@pytest.mark.parametrize("yaw_deg", [-80, -35, 0, 20, 65])
def test_heading_and_size_of_an_l_of_points(yaw_deg):
    xy = l_shape(4.2, 1.7, np.deg2rad(yaw_deg), [12.0, 5.0]) + np.random.default_rng(0).normal(0, 0.02, (120, 2))
    x, y = xy.T.astype(np.float32)
    groups = groups_of([120])
    box = upright_boxes(
        np.stack([x, y, np.zeros(120, np.float32)]),
        groups.offsets,
        HEADINGS[best_headings(x, y, groups, 1000, SIDE_NOISE_M)],
    )[0]
    error = (box[6] - np.deg2rad(yaw_deg) + np.pi / 2) % np.pi - np.pi / 2
    assert abs(error) < np.deg2rad(2.6)
    assert box[:2] == pytest.approx([12.0, 5.0], abs=0.15)
    assert box[3:5] == pytest.approx([4.2, 1.7], abs=0.25)


def test_groups_leave_out_rows_without_a_label():
    groups = Groups.from_labels(np.array([1, -1, 0, 1, 0, -1]), 2)
    assert groups.rows.tolist() == [2, 4, 0, 3]
    assert groups.offsets.tolist() == [0, 2, 4]


@given(sizes=st.lists(st.integers(1, 300), min_size=1, max_size=5), limit=st.integers(1, 64))
def test_subsampled_groups_have_between_one_row_and_the_limit(sizes, limit):
    few = groups_of(sizes).subsample(limit)
    assert (few.count <= limit).all()
    assert (few.count >= 1).all()
    own = np.repeat(np.arange(len(sizes)), sizes)
    assert np.array_equal(own[few.rows], np.repeat(np.arange(len(sizes)), few.count))
