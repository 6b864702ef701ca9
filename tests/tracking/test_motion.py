"""Displacements of tracks by both of their ends."""

from __future__ import annotations

import numpy as np
import pytest

from modt.classes import ObjectClass
from modt.geometry.kdop import DIRECTIONS
from modt.tracking.track_table import LAG_S, TrackTable

PERIOD_S = 0.1
ROW = np.array([0])


def kdop(corners: np.ndarray) -> np.ndarray:
    """(1, 8) of points (n, 2)."""
    return (corners @ DIRECTIONS).max(axis=0)[None]


def box(x: float, y: float, length: float, width: float) -> np.ndarray:
    return np.array([x, y]) + np.array([[0, 0], [length, 0], [0, width], [length, width]])


def follow(frames: list[np.ndarray], confirmed: ObjectClass = ObjectClass.BACKGROUND) -> TrackTable:
    tracks = TrackTable.blank(1)
    tracks.final[:], tracks.last_class[:] = True, confirmed
    for k, corners in enumerate(frames):
        tracks.kdop[:] = kdop(corners)
        tracks.box[:, 3:5] = np.ptp(corners, axis=0)
        if not k:
            tracks.lagged_kdop[:], tracks.size_m[:] = tracks.kdop, tracks.box[:, 3:6]
        tracks.observe_motion(ROW, PERIOD_S * (k > 0))
    return tracks


@pytest.mark.parametrize("bearing_rad", np.linspace(0, 2 * np.pi, 9))
def test_a_steady_walk_tends_to_speed_times_lag(bearing_rad: float) -> None:
    step = 1.2 * PERIOD_S * np.array([np.cos(bearing_rad), np.sin(bearing_rad)])
    tracks = follow([box(0, 0, 0.5, 0.5) + k * step for k in range(80)])
    assert tracks.moved_m[0] == pytest.approx(1.2 * LAG_S, rel=0.12)  # axes are 45 degrees apart
    assert tracks.observed_s[0] == pytest.approx(7.9)


def test_a_wall_whose_visible_part_grows_stays() -> None:
    tracks = follow([box(0, 0, 1.0 + 0.1 * k, 0.3) for k in range(40)])
    assert tracks.moved_m[0] < 0.01
    assert tracks.size_m[0, 0] == pytest.approx(4.9, abs=0.2)


def test_the_size_is_that_of_the_whole_object_while_most_of_it_is_hidden() -> None:
    seen = [box(0, 0, 4.3, 1.8)] * 10
    hidden = follow([*seen, *[box(0, 0, 1.8, 0.6)] * 30]).size_m[0]
    assert hidden[0] > 3.0
    assert follow([*seen, box(0, 0, 6.0, 1.8), *seen]).size_m[0, 0] < 5.2  # merged with something for once


def test_a_cyclist_who_passes_by_a_wall_is_not_as_large_as_it() -> None:
    seen = [box(0, 0, 1.5, 0.7)] * 10
    frames = [*seen, box(0, 0, 2.4, 2.3), *seen]
    assert follow(frames, ObjectClass.CYCLIST).size_m[0, 1] < 0.9 < 1.2 < follow(frames).size_m[0, 1]


def test_a_door_that_turns_about_its_hinge_goes_less_than_its_end() -> None:
    leaf = [np.array([[0, 0], [np.cos(a), np.sin(a)]]) for a in np.linspace(0, np.pi / 2, 20)]
    assert follow(leaf).moved_m[0] < 0.5


def test_what_jitters_stays() -> None:
    noise = np.random.default_rng(0).normal(0, 0.03, (60, 2))
    assert follow([box(0, 0, 0.5, 0.5) + n for n in noise]).moved_m[0] < 0.2


def test_a_first_proposal_has_no_displacement() -> None:
    tracks = follow([box(5, 5, 0.5, 0.5)])
    assert (tracks.moved_m[0], tracks.observed_s[0]) == (0.0, 0.0)
