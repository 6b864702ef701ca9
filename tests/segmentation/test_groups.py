"""Groups of points: their headings, boxes and statistics of reflectance."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from modt.config import SegmentationConfig, SensorConfig
from modt.geometry import FieldOfView, upright_boxes
from modt.segmentation.groups import (
    BRIGHT,
    DARK,
    HEADINGS,
    Groups,
    best_headings,
    has_reflectance,
    reflectance_statistics,
)
from modt.segmentation.segmenter import Segmenter
from modt.segmentation.tuning import SegmentationTuning
from modt.types import N_REFLECTANCE, UNRECORDED
from tests.segmentation import reference, scans

SIDE_NOISE_M = SegmentationTuning().heading.side_noise_m


def groups_of(sizes):
    return Groups.from_labels(np.repeat(np.arange(len(sizes)), sizes), len(sizes))


def l_shape(length, width, yaw, centre, n=60):
    """The two sides of a car that face the sensor."""
    t = np.linspace(-0.5, 0.5, n)
    local = np.concatenate(
        [np.stack([t * length, np.full(n, -width / 2)], 1), np.stack([np.full(n, -length / 2), t * width], 1)]
    )
    c, s = np.cos(yaw), np.sin(yaw)
    return local @ np.array([[c, s], [-s, c]]) + centre


@given(seed=st.integers(0, 10_000), sizes=st.lists(st.integers(1, 40), min_size=1, max_size=6))
def test_headings_and_boxes_are_those_of_each_cluster_alone(seed, sizes):
    """In the frame of a box its points reach its sides, and its length is not below its width."""
    xyz = np.random.default_rng(seed).normal(0, 2, (3, sum(sizes))).astype(np.float32)
    groups = groups_of(sizes)
    best = best_headings(xyz[0], xyz[1], groups, 1000, SIDE_NOISE_M)
    boxes = upright_boxes(xyz, groups.offsets, HEADINGS[best])
    for points, heading, box in zip(
        np.split(xyz.astype(float), groups.offsets[1:-1], axis=1), best, boxes, strict=True
    ):
        closeness = reference.closeness(points[0], points[1], SIDE_NOISE_M)
        assert closeness[heading] >= closeness.max() * 0.999
        across = np.isclose(box[6], HEADINGS[heading] - np.pi / 2)
        assert across or box[6] == HEADINGS[heading]
        x, y, z = points - box[:3, None]
        c, s = np.cos(box[6]), np.sin(box[6])
        reach = np.stack([x * c + y * s, y * c - x * s, z])
        assert_allclose(np.stack([-reach.min(axis=1), reach.max(axis=1)]), [box[3:6] / 2] * 2, atol=1e-4)
        assert box[3] >= box[4]


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


GROUPS = st.lists(
    st.lists(st.floats(0, 1, width=32) | st.just(UNRECORDED), min_size=1, max_size=9), min_size=1, max_size=6
)


@given(GROUPS)
def test_statistics_of_each_group_are_of_the_returns_with_reflectance(groups: list[list[float]]) -> None:
    points = np.zeros((sum(map(len, groups)), 4), np.float32)
    points[:, 3] = [value for group in groups for value in group]
    offsets = np.append(0, np.cumsum([len(group) for group in groups]))
    found = reflectance_statistics(points, np.arange(len(points)), offsets)
    assert found.shape == (len(groups), N_REFLECTANCE)
    for row, group in zip(found, groups, strict=True):
        own, expected = np.array([v for v in group if v != UNRECORDED], np.float32), [np.nan] * N_REFLECTANCE
        if len(own):
            expected = [own.mean(), own.std(), own.max(), (own > BRIGHT).mean(), (own < DARK).mean()]
        assert_allclose(row, expected, atol=2e-3)


@pytest.mark.parametrize("fov", [FieldOfView(), FieldOfView(np.array([[0.0, 1.0, 0.0, 0.0]]))], ids=["full", "left"])
def test_proposals_have_the_statistics_of_their_returns_with_reflectance(fov: FieldOfView) -> None:
    points, on = scans.scan([(12.0, 3.0, 4.2, 1.8, 0.2, 1.8), (9.0, 8.0, 0.5, 0.5, 0.0, 1.75)])
    points[:, 3] = np.where(on == 1, UNRECORDED, np.linspace(0.1, 0.7, len(points)))
    stage = Segmenter(SegmentationConfig(), SensorConfig(reflectance="hdl-64e"), fov)
    partly = stage.segment(points)
    assert partly.reflectance is not None
    means = [np.mean(np.where(v < 0, np.nan, v)) for v in np.split(points[partly.members, 3], partly.offsets[1:-1])]
    assert {True, False} == set(np.isnan(means).tolist())
    assert_allclose(partly.reflectance[:, 0], means, atol=1e-5)
    assert_array_equal(np.isnan(partly.reflectance).all(axis=1), np.isnan(means))
    assert Segmenter(SegmentationConfig(), SensorConfig(), fov).segment(points).reflectance is None  # of no scale
    points[:, 3] = UNRECORDED
    without = stage.segment(points)
    assert without.reflectance is None
    assert_array_equal(without.members, partly.members)
    assert_array_equal(without.box, partly.box)


@given(st.integers(1, 5000), st.floats(0, 1, width=32))
def test_a_sweep_of_equal_values_has_no_reflectance(n: int, value: float) -> None:
    alike = np.full(n, value, np.float32)
    assert not has_reflectance(alike)
    assert not has_reflectance(np.concatenate([alike, np.full(n, UNRECORDED, np.float32)]))
    assert has_reflectance(np.concatenate([alike, alike + np.float32(0.25)]))
