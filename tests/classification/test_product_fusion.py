"""Fusion as the paper writes it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose

from modt.classification.prior import FrequencyPrior
from modt.classification.product_fusion import AnyView, KeyViews
from modt.config import FusionConfig
from tests.classification.scenes import Fused, with_points

PAPER = FusionConfig(rule="product", start_frame=1)
ALIKE = FrequencyPrior(np.full(4, 0.25))
CAR = [0.2, 0.6, 0.1, 0.1]


def key_views(**options):
    return Fused(KeyViews(dataclasses.replace(PAPER, **options), ALIKE), 50)


@given(
    arrays(np.float64, (5, 4), elements=st.floats(0.05, 1.0)),
    arrays(np.float64, (3,), elements=st.floats(0.02, 0.3)),
)
def test_key_views_are_fused_by_equation_6(views, prior):
    views = views / views.sum(axis=1, keepdims=True)
    full = np.append(1 - prior.sum(), prior)
    subject = Fused(KeyViews(dataclasses.replace(PAPER, object_threshold=1.0), FrequencyPrior(full)), 50)
    expected = full.copy()
    for view in views:
        subject.fuse(*view)
        expected = expected * view / full  # slow reference: P(X) times each P(X|Y) / P(X)
        expected /= expected.sum()
        if expected.min() < 1e-3:
            return  # the floor applies from here on
        assert_allclose(subject.tracks.posterior[0], expected, rtol=1e-6)
    assert subject.tracks.views[0] == len(views)


def test_the_first_view_of_the_efficient_mode_is_final_whatever_it_is():
    subject = Fused(AnyView(PAPER, ALIKE), 50)
    assert subject.asks() == [True]
    assert subject.fuse(0.4, 0.2, 0.2, 0.2).all()
    assert subject.asks() == [False]


@pytest.mark.parametrize(
    ("points", "class_", "independent"),
    [(50, 1, False), (59, 1, False), (62, 1, True), (38, 1, True), (62, 0, False), (62, 2, True), (58, 2, False)],
)
def test_independence_by_the_change_of_points_that_the_most_probable_class_needs(points, class_, independent):
    subject = key_views(point_change=(0.5, 0.2, 0.2, 0.9))
    subject.fuse(*CAR)
    subject.tracks.posterior[0] = np.where(np.arange(4) == class_, 0.7, 0.1)
    subject.proposals = with_points(subject.proposals, points)
    assert subject.asks() == [independent]


def test_a_view_before_the_start_frame_is_not_final_however_distinct_and_replaced_there():
    subject = key_views(start_frame=3)
    misled = [0.005, 0.01, 0.98, 0.005]
    distinct = [0.98, 0.01, 0.005, 0.005]
    assert not subject.fuse(*misled).any()
    assert_allclose(subject.tracks.posterior[0], misled, rtol=1e-6)
    subject.tracks.age[:] = 2
    assert subject.asks() == [False]
    subject.tracks.age[:] = 3
    assert subject.asks() == [True]
    assert subject.fuse(*distinct).all()
    assert_allclose(subject.tracks.posterior[0], distinct, rtol=1e-6)
    assert subject.tracks.views.tolist() == [1]


def test_no_class_is_excluded_for_good():
    subject = key_views()
    for view in [[1.0, 0.0, 0.0, 0.0]] * 50 + [[0.01, 0.97, 0.01, 0.01]] * 4:
        subject.fuse(*view)
    assert subject.tracks.posterior[0].argmax() == 1
