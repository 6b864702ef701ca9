"""What motion says of the class."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from modt.classes import ObjectClass
from modt.classification.motion_witness import LOG_LIKELIHOOD_RATIO, TOO_LARGE, log_likelihood

CAR, PEDESTRIAN, CYCLIST = (int(c) for c in (ObjectClass.CAR, ObjectClass.PEDESTRIAN, ObjectClass.CYCLIST))


def said(moved_m: float, observed_s: float, length_m: float, width_m: float = 0.4) -> np.ndarray:
    return log_likelihood(np.array([moved_m]), np.array([observed_s]), np.array([[length_m, width_m, 1.5]]))[0]


@given(st.floats(0, 1e3), st.floats(0, 1e4), st.floats(0, 1e3))
def test_it_says_little_enough_to_be_contradicted(moved_m: float, observed_s: float, length_m: float) -> None:
    found = said(moved_m, observed_s, length_m)
    assert found[0] == 0.0
    assert np.abs(found[:CYCLIST]).max() <= np.abs(LOG_LIKELIHOOD_RATIO).max() == 1.5
    assert np.abs(found[CYCLIST]) <= 1.5 + TOO_LARGE


def test_what_walks_is_a_pedestrian() -> None:
    walks = said(1.5, 4.0, 0.7)
    assert walks.argmax() == PEDESTRIAN
    assert walks[PEDESTRIAN] > 1.0


def test_what_went_far_is_a_vehicle() -> None:
    assert said(8.0, 4.0, 1.8).argmax() in (CAR, CYCLIST)
    assert said(15.0, 4.0, 4.2)[CAR] > 1.0
    assert said(15.0, 4.0, 4.2)[PEDESTRIAN] < 0


def test_what_stands_for_seconds_is_hardly_a_cyclist() -> None:
    assert said(0.1, 5.0, 1.8).argmin() == CYCLIST


def test_a_young_track_says_little() -> None:
    assert np.abs(said(0.0, 0.1, 0.7)).max() < np.abs(said(0.0, 3.0, 0.7)).max()


def test_no_tracks() -> None:
    none = np.zeros(0)
    assert log_likelihood(none, none, np.zeros((0, 3))).shape == (0, 4)


def test_a_fragment_that_moves_with_its_car_is_no_person() -> None:
    assert said(2.5, 2.0, 0.24)[PEDESTRIAN] < 0 < said(2.5, 2.0, 0.5)[PEDESTRIAN]


def test_what_was_seen_wider_or_longer_than_a_cyclist_is_none() -> None:
    cyclist = said(6.0, 3.0, 1.8, 0.7)[CYCLIST]
    assert cyclist - said(6.0, 3.0, 1.8, 1.5)[CYCLIST] == TOO_LARGE
    assert said(6.0, 3.0, 2.5, 0.7)[CYCLIST] < -1
