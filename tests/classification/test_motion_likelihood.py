"""Likelihood of the classes by the motion of a track."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.classes import ObjectClass
from modt.classification.motion_likelihood import LOG_LIKELIHOOD_RATIO, MotionLikelihood
from modt.classification.tuning import MotionTuning

CAR, PEDESTRIAN, CYCLIST = (int(c) for c in (ObjectClass.CAR, ObjectClass.PEDESTRIAN, ObjectClass.CYCLIST))


def ratios(moved_m, observed_s, length_m, width_m=0.4, is_whole=False):
    size_m = np.array([[length_m, width_m, 1.5]])
    motion = MotionLikelihood(MotionTuning())
    return motion.log_ratio(np.array([moved_m]), np.array([observed_s]), size_m, np.array([is_whole]))[:, 0]


@given(st.floats(0, 1e3), st.floats(0, 1e4), st.floats(0, 1e3))
def test_no_motion_rules_a_class_out(moved_m, observed_s, length_m):
    found = ratios(moved_m, observed_s, length_m)
    assert found[0] == 0.0
    assert np.abs(found[:CYCLIST]).max() <= np.abs(LOG_LIKELIHOOD_RATIO).max() == 1.5
    assert np.abs(found[CYCLIST]) <= 1.5 + MotionTuning().oversize_penalty


@pytest.mark.parametrize(
    ("moved_m", "observed_s", "length_m", "likely", "unlikely"),
    [
        (1.5, 4.0, 0.7, [PEDESTRIAN], []),  # walks
        (15.0, 4.0, 4.2, [CAR], [PEDESTRIAN, CYCLIST]),  # went far
        (0.1, 5.0, 1.8, [], [CYCLIST]),  # stands for seconds
    ],
)
def test_motion_tells_classes_apart(moved_m, observed_s, length_m, likely, unlikely):
    found = ratios(moved_m, observed_s, length_m)
    assert (found[likely] > 1.0).all()
    assert (found[unlikely] < 0.0).all()


@pytest.mark.parametrize(
    ("class_", "less", "more"),
    [
        (PEDESTRIAN, (2.5, 2.0, 0.24), (2.5, 2.0, 0.5)),  # a fragment that moves with its car
        (CYCLIST, (6.0, 3.0, 2.5, 0.7), (6.0, 3.0, 1.8, 0.7)),  # was seen longer than a cyclist
        (CYCLIST, (6.0, 3.0, 1.8, 1.5), (6.0, 3.0, 1.8, 0.7)),  # was seen wider
    ],
)
def test_what_was_seen_too_small_or_too_large_for_a_class_is_hardly_one(class_, less, more):
    assert ratios(*less)[class_] < 0 < ratios(*more)[class_]


@pytest.mark.parametrize(("length_m", "is_less"), [(1.9, False), (2.5, True), (3.5, False)])
def test_what_shows_itself_whole_is_as_long_as_a_vehicle_or_as_wide(length_m, is_less):
    apart = ratios(0.0, 3.0, length_m)
    whole = ratios(0.0, 3.0, length_m, is_whole=True)
    assert apart[CAR] - whole[CAR] == (MotionTuning().between_penalty if is_less else 0.0)
    assert (whole == apart)[[PEDESTRIAN, CYCLIST]].all()


def test_a_young_track_weighs_little():
    assert np.abs(ratios(0.0, 0.1, 0.7)).max() < np.abs(ratios(0.0, 3.0, 0.7)).max()
