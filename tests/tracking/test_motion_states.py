"""Movers are told from what only seems to move: surfaces behind others, what sways or flickers, a turning robot."""

import numpy as np
import pytest

from modt.classes import ObjectClass
from modt.config import TrackingConfig
from modt.types import MotionState, PointKind
from tests.tracking.test_sight import scene, wall
from tests.tracking.tracking_scenes import EYE, Follower, box, driving, frame_of

PERIOD_S = 0.1


def follow(follower, scenes, **options):
    """Follow frames of boxes (P, 7); the motion and the speed of the oldest track in each of them."""
    motion = []
    speed_mps = []
    for boxes in scenes:
        tracks = follower.follow(*frame_of(boxes, follower.frames, **options))
        oldest = int(tracks.hits.argmax())
        motion.append(MotionState(tracks.motion[oldest]).name)
        speed_mps.append(float(np.hypot(*tracks.velocity[oldest])))
        follower.confirm([], [])
    return motion, speed_mps


def test_a_track_is_unknown_first_and_then_moves_or_is_still():
    still, speed_mps = follow(Follower(), [[box(8, 2, 0.6, 0.5)]] * 20)
    moving, _ = follow(Follower(), [[box(8 + 0.15 * k, 2, 0.6, 0.5)] for k in range(20)])
    assert still[:2] == moving[:2] == ["UNKNOWN", "UNKNOWN"]
    assert set(still[6:]) == {"STILL"}
    assert max(speed_mps[6:]) < 0.05
    assert set(moving[6:]) == {"MOVING"}


@pytest.mark.parametrize("size", [(0.5, 0.5), (4.0, 1.8)])
def test_a_start_is_seen_within_three_frames_and_a_stop_within_five(size):
    x = 8 + np.cumsum([0] * 20 + [0.2] * 20 + [0] * 20)
    motion, speed_mps = follow(Follower(), [[box(each, 2, *size)] for each in x])
    assert motion[19] == "STILL"
    assert motion[20 + 3] == "MOVING"
    assert motion[40 + 4] == "STILL"
    assert speed_mps[40 + 4] < 0.15


def test_nothing_moves_while_the_robot_turns():
    boxes = [box(20, 5), box(15, -4, 0.5, 0.5), box(9, 7, 1.0, 0.3)]
    follower = Follower()
    in_world = np.linalg.inv(driving(0))
    for index in range(30):
        T = driving(index)
        seen = [(in_world @ T, each) for each in boxes]
        relative = []
        for change, each in seen:
            x, y, z = (np.linalg.inv(change) @ [*each[:3], 1.0])[:3]
            relative.append([x, y, z, *each[3:6], -np.arctan2(change[1, 0], change[0, 0])])
        tracks = follower.follow(*frame_of(relative, index, T, points=2000))
        follower.confirm([], [])
    assert len(tracks) == len(boxes)
    assert (tracks.motion == MotionState.STILL).all()
    assert np.hypot(*tracks.velocity.T).max() < 0.1


def test_a_branch_that_sways_does_not_move():
    sway = 0.1 * np.sin(2 * np.pi * 0.5 * PERIOD_S * np.arange(60))
    motion, _ = follow(Follower(), [[box(8 + each, 2 + each, 1.0, 1.0)] for each in sway])
    assert "MOVING" not in motion


def test_flicker_does_not_move():
    n_frames = 40
    n_things = 12
    rng = np.random.default_rng(4)
    follower = Follower()
    moving = 0
    for index in range(n_frames):
        spots = rng.uniform(-8, 8, (n_things, 2))
        tracks = follower.follow(*frame_of([box(*spot, 0.3, 0.3, 0.4) for spot in spots], index))
        follower.confirm([], [])
        moving += int(np.count_nonzero(tracks.observed & (tracks.motion == MotionState.MOVING)))
    assert moving < 0.05 * n_frames * n_things


@pytest.mark.parametrize(("steady_frames", "state"), [(0, "UNKNOWN"), (10, "MOVING")])
def test_no_track_starts_to_move_as_it_reappears_and_one_that_moves_goes_on(steady_frames, state):
    seen = [index < steady_frames or index % 2 == 0 for index in range(24)]
    scenes = [[box(8 + 0.15 * index, 2, 0.6, 0.5)] if is_seen else [] for index, is_seen in enumerate(seen)]
    motion, _ = follow(Follower(), scenes)
    assert {motion[index] for index in range(12, 24) if seen[index]} == {state}


@pytest.mark.parametrize(
    ("object_class", "probability", "state"),
    [
        (ObjectClass.PEDESTRIAN, 0.8, "MOVING"),
        (ObjectClass.PEDESTRIAN, 0.4, "STILL"),
        (ObjectClass.BACKGROUND, 0.8, "UNKNOWN"),
    ],
)
def test_an_object_that_moves_does_so_until_it_is_more_likely_at_rest(object_class, probability, state):
    follower = Follower()
    assert follow(follower, [[box(8 + 0.15 * k, 2, 0.6, 0.5)] for k in range(12)])[0][-1] == "MOVING"
    follower.set_class(0, object_class)
    follower.tracks.moving_probability[:] = probability
    assert follow(follower, [[]])[0] == [state]


@pytest.mark.parametrize(
    ("object_class", "way_m", "state"),
    [
        (ObjectClass.PEDESTRIAN, 1.3, "MOVING"),
        (ObjectClass.PEDESTRIAN, 0.9, "UNKNOWN"),
        (ObjectClass.CAR, 1.3, "UNKNOWN"),
        (ObjectClass.BACKGROUND, 1.3, "UNKNOWN"),
    ],
)
def test_an_object_that_probably_moves_does_so_once_it_is_gone_farther_than_its_length(object_class, way_m, state):
    follower = Follower()
    scene_at_rest = [box(8, 2, 0.6, 0.5)]
    assert follow(follower, [scene_at_rest] * 12)[0][-1] == "STILL"
    follower.set_class(0, object_class)
    follower.tracks.moving_probability[:] = 0.8
    follower.tracks.rest_position[:, 0] -= way_m
    assert follow(follower, [[]])[0] == [state]


@pytest.mark.parametrize(("hidden", "moves"), [(True, False), (False, True)])
def test_a_surface_between_what_hides_it_does_not_move(hidden, moves):
    follower = Follower()
    for index in range(25):
        shift = 0.15 * index
        boxes = [wall(shift - 1.0, shift + 1.0)]
        kinds = [PointKind.MEMBER]
        if hidden:
            boxes += [wall(shift / 2 - 1.2, shift / 2 - 0.5, x=5.0), wall(shift / 2 + 0.5, shift / 2 + 1.2, x=5.0)]
            kinds += [PointKind.STRUCTURE, PointKind.STRUCTURE]
        _, proposals = scene(boxes, kinds)
        frame, _ = frame_of(boxes, index, points=3000)
        tracks = follower.follow(frame, proposals)
        follower.confirm([], [])
    assert bool(tracks.motion[tracks.hits.argmax()] == MotionState.MOVING) == moves


@pytest.mark.parametrize(("step_m", "state"), [(0.15, "MOVING"), (0.0, "STILL")])
def test_who_walks_beside_what_moves_along_is_known_to_move_before_a_persons_length_is_gone(step_m, state):
    follower = Follower()
    for index in range(8):
        y = step_m * index
        boxes = [box(6, y, 0.5, 0.5), box(6, y + 0.65, 0.6, 0.6)]
        _, proposals = scene(boxes, [PointKind.MEMBER] * 2)
        frame, _ = frame_of(boxes, index, EYE, points=3000)
        tracks = follower.follow(frame, proposals)
        follower.set_class(0, ObjectClass.PEDESTRIAN)
        follower.confirm([], [])
    assert MotionState(tracks.motion[0]).name == state


def test_the_papers_filter_tells_the_velocity_alone():
    follower = Follower(TrackingConfig(association="paper", extensions="none"))
    for index in range(20):
        tracks = follower.follow(*frame_of([box(8 + 0.15 * index, 2)], index))
        follower.confirm([], [])
    assert tracks.motion[0] == MotionState.UNKNOWN
    np.testing.assert_allclose(tracks.velocity[0], [1.5, 0.0], atol=0.3)
    assert np.linalg.eigvalsh(tracks.velocity_covariance[0]).min() > 0
