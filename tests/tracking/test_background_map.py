"""New proposals take over the class of background that stands, or stood, where they appear."""

import numpy as np
import pytest

from modt.classes import ObjectClass
from modt.config import TrackingConfig
from modt.observations import observe
from modt.tracking.background_map import BackgroundMap
from modt.tracking.states import ACCURATE, CONVENTIONAL, EFFICIENT
from tests.tracking.tracking_scenes import EYE, Follower, box, frame_of, tracks_at

BACKGROUND = ObjectClass.BACKGROUND
CAR = ObjectClass.CAR
POST = box(10, 4, 1, 1)
FAR = box(30, 0, 1, 1)
EMPTY = tracks_at([])
NO_ROWS = np.zeros(0, np.int64)


def recalled(background_map, boxes, tracks=EMPTY, rows=NO_ROWS, which=None):
    observations = observe(frame_of(boxes)[1], EYE)
    which = np.arange(len(boxes)) if which is None else np.array(which)
    return background_map.recall(tracks, rows, observations, which).tolist()


def map_of(*boxes, **options):
    background_map = BackgroundMap(**options)
    background_map.add(tracks_at(boxes), np.arange(len(boxes)))
    return background_map


@pytest.mark.parametrize(
    ("stranger", "known"),
    [
        (POST, True),
        (box(10.2, 4, 1, 1), True),
        (box(10, 4, 0.4, 0.4, h=0.5), True),
        (box(10, 4, 1, 1, h=1.9, z=-0.8), True),  # rises 0.4 m above
        (box(10, 4, 1, 1, h=2.1, z=-0.7), False),  # rises 0.6 m above
        (box(12, 4, 1, 1), False),
        (box(10, 4, 3, 3), False),
    ],
)
def test_a_proposal_within_a_place_is_recalled_unless_it_rises_above(stranger, known):
    assert recalled(map_of(FAR, POST), [stranger]) == [known]
    assert recalled(BackgroundMap(), [stranger], tracks_at([FAR, POST]), np.arange(2)) == [known]


def test_only_the_rows_and_observations_named_count():
    tracks = tracks_at([FAR, POST])
    nothing = BackgroundMap()
    assert recalled(nothing, [POST, FAR], tracks, np.array([0])) == [False, True]
    assert recalled(nothing, [POST, FAR], tracks, np.array([0]), which=[1]) == [True]
    assert recalled(nothing, [POST, FAR], tracks, np.array([0]), which=NO_ROWS) == []
    nothing.add(tracks, np.array([1]))
    assert recalled(nothing, [POST, FAR]) == [True, False]


def test_the_oldest_places_beyond_the_capacity_are_forgotten():
    boxes = [box(10 + 5 * i, 0, 1, 1) for i in range(5)]
    assert recalled(map_of(*boxes, capacity=3), boxes) == [False, False, True, True, True]
    by_one = BackgroundMap(capacity=3)
    for row in range(5):
        by_one.add(tracks_at(boxes), np.array([row]))
    assert recalled(by_one, boxes) == [False, False, True, True, True]
    assert recalled(map_of(POST, capacity=0), [POST], tracks_at([POST]), np.arange(1)) == [False]


@pytest.mark.parametrize(
    ("object_class", "extensions", "machine", "remembered"),
    [
        (BACKGROUND, "all", EFFICIENT, True),
        (BACKGROUND, "all", ACCURATE, True),
        (BACKGROUND, "all", CONVENTIONAL, False),  # no class is final
        (BACKGROUND, "none", EFFICIENT, False),
        (CAR, "all", EFFICIENT, False),
    ],
)
def test_the_heir_of_background_is_final_at_once(object_class, extensions, machine, remembered):
    follower = Follower(TrackingConfig(max_missed=2, extensions=extensions), machine)
    follower.run([[FAR, POST]] * 4 + [[FAR]] * 5, object_class)
    assert follower.tracks.id.tolist() == [0]
    assert follower.run([[FAR, POST]]) == (not remembered)
    assert follower.tracks.inherited.tolist() == [False, remembered]


WALL = [[box(10, 3, 12, 2.0, 1.8)]] * 4
PART = [[box(10, 3.6, 12, 0.8, 1.8), box(10, 2.8 - 0.15 * i, 0.5, 0.5, 1.7)] for i in range(8)]
"""A pedestrian who was segmented with a wall walks away from it."""


def test_background_that_leaves_its_place_loses_its_class_and_is_classified():
    follower = Follower()
    follower.run(WALL)
    assert follower.run(PART[:2]) == 0
    assert follower.tracks.inherited.tolist() == [False, True]
    for boxes in PART[2:]:
        follower.follow(*frame_of(boxes, follower.frames, EYE))
    assert follower.states == ["tracked", "unmatched"]
    assert follower.tracks.final.tolist() == [True, False]
    assert follower.wants_class.tolist() == [False, True]
    assert not follower.tracks.inherited.any()


def test_a_class_that_a_view_confirmed_holds_away_from_the_place():
    follower = Follower()
    follower.run(WALL + PART[:2])
    follower.set_class(1, BACKGROUND)
    assert follower.run(PART[2:]) == 0
    assert follower.states == ["tracked", "tracked"]
    assert not follower.tracks.inherited.any()
