import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.box_tracking.box_tracker import BoxTracker, box_config
from modt.config import BoxTrackingConfig
from modt.types import NONE

CONFIG = BoxTrackingConfig(sure=-100.0, report_missed=2)


def car(x, y, yaw=0.0):
    return [x, y, -1.0, 4.0, 1.8, 1.5, yaw]


def shown(tracker, i, listed, score=5.0):
    boxes = np.array(listed, np.float64).reshape(-1, 7)
    scores = np.broadcast_to(np.asarray(score, np.float64), len(boxes))
    return tracker.follow(i * 0.1, boxes, scores, np.hypot(boxes[:, 0], boxes[:, 1]))


def follow(frames, config=CONFIG, score=5.0):
    tracker = BoxTracker(config)
    for i, listed in enumerate(frames):
        reported = shown(tracker, i, listed, score)
    return reported


def test_two_cars_that_meet_keep_their_names():
    r = follow([[car(10 + i, 0), car(40 - i, 3.5, np.pi)] for i in range(25)])
    order = np.argsort(r.box[:, 1])
    assert list(r.id[order]) == [0, 1]
    np.testing.assert_allclose(r.box[order, 0], [34, 16], atol=0.3)


def test_a_gap_is_bridged_along_the_prediction():
    frames = [[car(10 + 1.5 * i, 0)] if i not in (8, 9) else [] for i in range(12)]
    during, after = follow(frames[:10]), follow(frames)
    assert list(during.source) == [NONE]
    np.testing.assert_allclose(during.box[0, 0], 10 + 1.5 * 9, atol=0.6)
    assert list(after.id) == [0]


def test_a_sensor_that_turns_loses_nothing():
    """A parked car seen by a robot that turns at 1 rad/s: its course in the sensor's frame changes all the time."""
    bearing = np.pi / 4 - 0.1 * np.arange(12)
    r = follow([[car(30 * np.cos(b), 30 * np.sin(b), b)] for b in bearing])
    assert list(r.id) == [0]
    np.testing.assert_allclose(r.box[0, :2], [30 * np.cos(bearing[-1]), 30 * np.sin(bearing[-1])], atol=0.2)


def test_headings_do_not_flip():
    r = follow([[car(10 + i, 0, np.pi * (i % 2))] for i in range(9)])
    assert abs(np.cos(r.box[0, 6])) > 0.99
    assert np.cos(r.box[0, 6]) > 0


def test_the_weak_continue_a_track_but_begin_none():
    config = BoxTrackingConfig(sure=-100.0, strong_score=2.0)
    assert len(follow([[car(10, 0)]] * 3, config, score=1.0).id) == 0
    tracker = BoxTracker(config)
    for i, score in enumerate([3.0, 1.0, 1.0]):
        reported = shown(tracker, i, [car(10, 0)], score)
    assert list(reported.id) == [0]
    assert list(reported.source) == [0]


def test_the_sure_are_reported_at_once_and_others_with_age():
    config = BoxTrackingConfig(sure=5.0, range_bonus_per_m=0.0, age_bonus=1.0)
    assert len(follow([[car(10, 0)]], config, score=4.0).id) == 0
    assert len(follow([[car(10, 0)]], config, score=5.0).id) == 1
    assert len(follow([[car(10, 0)]] * 2, config, score=4.0).id) == 0
    assert len(follow([[car(10, 0)]] * 3, config, score=4.0).id) == 1


def test_a_low_score_says_less_against_what_is_far():
    config = BoxTrackingConfig(sure=5.0, range_bonus_per_m=0.1)
    r = follow([[car(10, 0), car(40, 0)]], config, score=3.0)
    np.testing.assert_allclose(r.box[:, 0], 40)
    np.testing.assert_allclose(r.confidence, 3.0 + 0.1 * 40)


def test_doubt_takes_a_track_out_of_the_report_but_not_its_name():
    config = BoxTrackingConfig(sure=5.0, range_bonus_per_m=0.0, score_gain=1.0, age_bonus=0.0)
    tracker = BoxTracker(config)
    ids = [list(shown(tracker, i, [car(10, 0)], s).id) for i, s in enumerate([6.0, 1.0, 6.0])]
    assert ids == [[0], [], [0]]


def test_what_scores_less_moves_a_track_less():
    frames = [[car(10, 0)]] * 9
    sure, unsure = BoxTracker(CONFIG), BoxTracker(CONFIG)
    for i, listed in enumerate(frames):
        shown(sure, i, listed)
        shown(unsure, i, listed)
    by_sure = shown(sure, 9, [car(10.5, 0)], 12.0).box[0, 0]
    by_unsure = shown(unsure, 9, [car(10.5, 0)], 0.0).box[0, 0]
    assert 10 < by_unsure < by_sure - 0.1 < 10.4


@given(st.lists(st.lists(st.tuples(st.floats(-30, 30), st.floats(-30, 30)), max_size=5), max_size=8))
def test_each_detection_is_one_track_at_most(scene):
    tracker = BoxTracker(CONFIG)
    for i, places in enumerate(scene):
        r = shown(tracker, i, [car(x, y) for x, y in places])
        seen = r.source[r.source != NONE]
        assert sorted(seen) == list(range(len(places)))
        assert len(set(r.id)) == len(r.id)
        assert np.isfinite(r.box).all()


@pytest.mark.parametrize("name", ["Car", "Pedestrian", "Cyclist"])
def test_every_type_has_a_configuration(name):
    assert box_config(name).max_missed > 0
