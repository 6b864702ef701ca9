"""Statistics of the reflectance of clusters."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.config import SegmentationConfig, SensorConfig
from modt.geometry import FieldOfView
from modt.segmentation.groups import BRIGHT, DARK, has_reflectance, reflectance_statistics
from modt.segmentation.segmenter import Segmenter
from modt.types import N_REFLECTANCE, UNRECORDED
from tests.segmentation import scans

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
        np.testing.assert_allclose(row, expected, atol=2e-3)


@pytest.mark.parametrize("fov", [FieldOfView(), FieldOfView(np.array([[0.0, 1.0, 0.0, 0.0]]))], ids=["full", "left"])
def test_proposals_have_the_statistics_of_their_returns_with_reflectance(fov: FieldOfView) -> None:
    points, on = scans.scan([(12.0, 3.0, 4.2, 1.8, 0.2, 1.8), (9.0, 8.0, 0.5, 0.5, 0.0, 1.75)])
    points[:, 3] = np.linspace(0.1, 0.7, len(points))
    stage = Segmenter(SegmentationConfig(), SensorConfig(reflectance="hdl-64e"), fov)
    whole = stage.segment(points)
    assert whole.reflectance is not None
    means = [points[own, 3].mean() for own in np.split(whole.members, whole.offsets[1:-1])]
    np.testing.assert_allclose(whole.reflectance[:, 0], means, atol=1e-5)
    points[on == 1, 3] = UNRECORDED
    partly = stage.segment(points)
    np.testing.assert_array_equal(partly.members, whole.members)
    np.testing.assert_array_equal(partly.box, whole.box)
    assert partly.reflectance is not None
    bare = on[whole.members[whole.offsets[:-1]]] == 1
    assert bare.any()
    assert np.isnan(partly.reflectance[bare]).all()
    np.testing.assert_array_equal(partly.reflectance[~bare], whole.reflectance[~bare])
    assert Segmenter(SegmentationConfig(), SensorConfig(), fov).segment(points).reflectance is None  # of no scale
    for nothing in (UNRECORDED, 0.0):
        points[:, 3] = nothing
        assert stage.segment(points).reflectance is None


@given(st.integers(1, 5000), st.floats(0, 1, width=32))
def test_a_sweep_of_equal_values_has_no_reflectance(n: int, value: float) -> None:
    alike = np.full(n, value, np.float32)
    assert not has_reflectance(alike)
    assert not has_reflectance(np.concatenate([alike, np.full(n, UNRECORDED, np.float32)]))
    assert has_reflectance(np.concatenate([alike, alike + np.float32(0.25)]))
