"""Fusion as the paper writes it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from modt.classification.prior import FrequencyPrior
from modt.classification.product_fusion import AnyView, KeyViews
from modt.config import FusionConfig
from modt.types import Float64
from tests.classification.scenes import ROW, YES, scene, with_points

PAPER = FusionConfig(rule="product", start_frame=1)
ALIKE = FrequencyPrior(np.full(4, 0.25))


@given(
    arrays(np.float64, (5, 4), elements=st.floats(0.05, 1.0)),
    arrays(np.float64, (3,), elements=st.floats(0.02, 0.3)),
)
def test_key_views_are_fused_by_equation_6(views: Float64, prior: Float64) -> None:
    views = views / views.sum(axis=1, keepdims=True)
    proposals, tracks, full = *scene(50), np.append(1 - prior.sum(), prior)
    fusion = KeyViews(dataclasses.replace(PAPER, object_threshold=1.0), FrequencyPrior(full))
    expected = full.copy()
    for view in views:
        fusion.fuse(tracks, proposals, ROW, view[None])
        expected = expected * view / full  # slow reference: P(X) times each P(X|Y) / P(X)
        expected /= expected.sum()
        if expected.min() < 1e-3:
            return  # the floor applies from here on
        np.testing.assert_allclose(tracks.posterior[0], expected, rtol=1e-6)
    assert tracks.views[0] == len(views)


def test_the_first_view_of_the_efficient_mode_is_final_whatever_it_says() -> None:
    proposals, tracks = scene(50)
    fusion = AnyView(PAPER, ALIKE)
    assert fusion.asks(tracks, proposals, YES).all()
    assert fusion.fuse(tracks, proposals, ROW, np.array([[0.4, 0.2, 0.2, 0.2]])).all()
    assert not fusion.asks(tracks, proposals, YES).any()


@pytest.mark.parametrize(("points", "independent"), [(50, False), (59, False), (62, True), (38, True)])
def test_independence_by_change_of_points(points: int, independent: bool) -> None:
    proposals, tracks = scene(50)
    fusion = KeyViews(PAPER, ALIKE)
    fusion.fuse(tracks, proposals, ROW, np.array([[0.2, 0.6, 0.1, 0.1]]))
    assert fusion.asks(tracks, with_points(proposals, points), YES)[0] == independent


def test_point_change_is_that_of_the_most_probable_class() -> None:
    proposals, tracks = scene(50)
    fusion = KeyViews(dataclasses.replace(PAPER, point_change=(0.5, 0.9, 0.1, 0.9)), ALIKE)
    fusion.fuse(tracks, proposals, ROW, np.array([[0.2, 0.6, 0.1, 0.1]]))
    more = with_points(proposals, 60)
    assert not fusion.asks(tracks, more, YES)[0]
    tracks.posterior[0] = [0.2, 0.2, 0.5, 0.1]
    assert fusion.asks(tracks, more, YES)[0]


def test_an_uncertain_early_view_is_replaced_at_the_start_frame() -> None:
    proposals, tracks = scene(50)
    fusion = KeyViews(dataclasses.replace(PAPER, start_frame=3), ALIKE)
    misled, clear = np.array([[0.1, 0.1, 0.7, 0.1]]), np.array([[0.2, 0.6, 0.1, 0.1]])
    fusion.fuse(tracks, proposals, ROW, misled)
    np.testing.assert_allclose(tracks.posterior[0], misled[0], rtol=1e-6)
    tracks.age[:] = 2
    assert not fusion.asks(tracks, proposals, YES).any()
    tracks.age[:] = 3
    assert fusion.asks(tracks, proposals, YES).all()
    fusion.fuse(tracks, proposals, ROW, clear)
    np.testing.assert_allclose(tracks.posterior[0], clear[0], rtol=1e-6)


def test_no_class_is_final_before_the_start_frame_however_distinct_a_view() -> None:
    proposals, tracks = scene(50)
    fusion = KeyViews(dataclasses.replace(PAPER, start_frame=4), ALIKE)
    distinct = np.array([[0.98, 0.01, 0.005, 0.005]])
    assert not fusion.fuse(tracks, proposals, ROW, distinct).any()
    tracks.age[:] = 4
    assert fusion.asks(tracks, proposals, YES).all()
    assert fusion.fuse(tracks, proposals, ROW, distinct).all()
    assert tracks.views.tolist() == [1]


def test_no_class_is_excluded_for_good() -> None:
    proposals, tracks = scene(50)
    fusion = KeyViews(PAPER, ALIKE)
    for _ in range(50):
        fusion.fuse(tracks, proposals, ROW, np.array([[1.0, 0.0, 0.0, 0.0]]))
    for _ in range(4):
        fusion.fuse(tracks, proposals, ROW, np.array([[0.01, 0.97, 0.01, 0.01]]))
    assert tracks.posterior[0].argmax() == 1
