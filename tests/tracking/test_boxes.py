import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.config import BoxTrackingConfig
from modt.tracking.boxes import BoxTracker, box_config
from modt.types import NONE

CONFIG = BoxTrackingConfig(min_hits=1, report_missed=2)


def car(x, y, yaw=0.0):
    return [x, y, -1.0, 4.0, 1.8, 1.5, yaw]


def follow(frames, config=CONFIG, score=5.0):
    tracker = BoxTracker(config)
    for i, listed in enumerate(frames):
        boxes = np.array(listed, np.float64).reshape(-1, 7)
        reported = tracker.follow(i * 0.1, boxes, np.full(len(boxes), score))
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


def test_headings_do_not_flip():
    r = follow([[car(10 + i, 0, np.pi * (i % 2))] for i in range(9)])
    assert abs(np.cos(r.box[0, 6])) > 0.99
    assert np.cos(r.box[0, 6]) > 0


def test_the_weak_continue_a_track_but_begin_none():
    config = BoxTrackingConfig(min_hits=1, strong_score=2.0)
    assert len(follow([[car(10, 0)]] * 3, config, score=1.0).id) == 0
    tracker = BoxTracker(config)
    box = np.array([car(10, 0)])
    for i, score in enumerate([3.0, 1.0, 1.0]):
        reported = tracker.follow(i * 0.1, box, np.array([score]))
    assert list(reported.id) == [0]
    assert list(reported.source) == [0]


def test_what_was_seen_once_waits_unless_it_is_sure():
    config = BoxTrackingConfig(min_hits=2, sure_score=4.0)
    assert len(follow([[car(10, 0)]], config, score=3.0).id) == 0
    assert len(follow([[car(10, 0)]], config, score=5.0).id) == 1
    assert len(follow([[car(10, 0)]] * 2, config, score=3.0).id) == 1


@given(st.lists(st.lists(st.tuples(st.floats(-30, 30), st.floats(-30, 30)), max_size=5), max_size=8))
def test_each_detection_is_one_track_at_most(scene):
    tracker = BoxTracker(CONFIG)
    for i, places in enumerate(scene):
        boxes = np.array([car(x, y) for x, y in places]).reshape(-1, 7)
        r = tracker.follow(0.1 * i, boxes, np.full(len(boxes), 5.0))
        seen = r.source[r.source != NONE]
        assert sorted(seen) == list(range(len(boxes)))
        assert len(set(r.id)) == len(r.id)
        assert np.isfinite(r.box).all()


@pytest.mark.parametrize("name", ["Car", "Pedestrian", "Cyclist"])
def test_every_type_has_a_configuration(name):
    assert box_config(name).max_missed > 0
