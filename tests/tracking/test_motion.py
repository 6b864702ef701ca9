"""Displacements of tracks by both of their ends."""

import numpy as np
import pytest

from modt.classes import ObjectClass
from modt.geometry.kernels import NUMPY_GEOMETRY
from modt.observations import observe
from modt.tracking.extent import extent_update_of
from modt.tracking.track_table import TrackTable
from modt.tracking.tuning import ExtentTuning
from tests.tracking.tracking_scenes import EYE, Follower, box, frame_of


def displacement(boxes):
    """Displacement of the track of one object [m], the time of its observation [s] and its size [m]."""
    follower = Follower()
    follower.run([[b] for b in boxes], points=1000)
    tracks = follower.tracks
    assert tracks.id.tolist() == [0]
    return tracks.moved_m[0], tracks.observed_s[0], tracks.size_m[0]


@pytest.mark.parametrize("bearing_rad", np.linspace(0, 2 * np.pi, 9))
def test_a_steady_walk_tends_to_speed_times_lag(bearing_rad):
    dx, dy = 0.12 * np.array([np.cos(bearing_rad), np.sin(bearing_rad)])
    moved_m, observed_s, _ = displacement([box(20 + k * dx, k * dy, 0.5, 0.5) for k in range(80)])
    assert moved_m == pytest.approx(1.2 * ExtentTuning().lag_s, rel=0.12)  # axes are 45 degrees apart
    assert observed_s == pytest.approx(7.9)


def test_a_wall_whose_visible_part_grows_stays():
    moved_m, _, size_m = displacement([box(20 + 0.05 * k, 5, 1.0 + 0.1 * k, 0.3) for k in range(40)])
    assert moved_m < 0.05
    assert size_m[0] == pytest.approx(4.9, abs=0.2)


def test_the_size_is_that_of_the_whole_object_while_most_of_it_is_hidden():
    seen = [box(20, 0, 4.3, 1.8)] * 10
    assert displacement([*seen, *[box(20, 0, 1.8, 0.6)] * 30])[2][0] > 3.0
    assert displacement([*seen, box(20, 0, 6.0, 1.8), *seen])[2][0] < 5.2  # merged with something for once


def test_a_cyclist_who_passes_by_a_wall_is_not_as_large_as_it():
    widths_m = []
    for confirmed in (ObjectClass.CYCLIST, ObjectClass.BACKGROUND):
        tracks = TrackTable.blank(1)
        tracks.final[:] = True
        tracks.object_class[:] = confirmed
        tracks.size_m[:] = [1.5, 0.7, 1.7]
        tracks.hits[:] = 1
        for width_m in (2.3, *[0.7] * 10):
            frame = observe(frame_of([box(10, 0, 1.5, width_m, 1.7)])[1], EYE)
            extent_update_of(NUMPY_GEOMETRY)(tracks, np.array([0]), np.array([0]), frame, frame.position, 0.1)
        widths_m.append(tracks.size_m[0, 1])
    assert widths_m[0] < 0.9 < 1.2 < widths_m[1]


def test_a_door_that_turns_about_its_hinge_goes_less_than_its_end():
    angles = np.linspace(0, np.pi / 2, 20)
    assert displacement([box(10 + np.cos(a) / 2, np.sin(a) / 2, 1.0, 0.05, yaw=a) for a in angles])[0] < 0.5


def test_what_jitters_stays():
    noise = np.random.default_rng(0).normal(0, 0.03, (60, 2))
    assert displacement([box(10 + x, y, 0.5, 0.5) for x, y in noise])[0] < 0.2


def test_a_first_proposal_has_no_displacement():
    assert displacement([box(5, 5, 0.5, 0.5)])[:2] == (0.0, 0.0)
