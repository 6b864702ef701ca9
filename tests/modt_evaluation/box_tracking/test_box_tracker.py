"""The box tracker, its filter against the full Kalman filter, and whole tracks."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from modt_evaluation.box_tracking import box_tracker
from modt_evaluation.box_tracking.box_tracker import BoxClass, BoxTracker
from modt_evaluation.box_tracking.sequences import BOX, bridged, iou_3d, of_one_class

CONFIG = BoxClass(report_above=-100.0, keep_above=0.0)
CONFIDENT = BoxClass(report_above=5.0, keep_above=0.0)


def car(x, y, yaw=0.0):
    return [x, y, -1.0, 4.0, 1.8, 1.5, yaw]


def step(tracker, i, listed, score=5.0):
    boxes = np.array(listed, np.float64).reshape(-1, 7)
    scores = np.broadcast_to(np.asarray(score, np.float64), len(boxes))
    return tracker.step(i * 0.1, boxes, scores, np.hypot(boxes[:, 0], boxes[:, 1]))


def follow(frames, config=CONFIG, score=5.0):
    tracker = BoxTracker(config)
    for i, listed in enumerate(frames):
        reported = step(tracker, i, listed, score)
    return reported


@pytest.mark.parametrize(("missed", "ids"), [(5, [0]), (30, [0]), (31, [1])])
def test_a_track_outlives_missed_detections_unreported_until_it_is_deleted(missed, ids):
    seen = [[car(10, 0)]] * 9 + [[]] * missed
    assert list(follow(seen).id) == []
    assert list(follow([*seen, [car(10, 0)]]).id) == ids


@pytest.mark.parametrize("missed", [0, 9, 29])
def test_the_gate_does_not_widen_while_a_track_is_missed(missed):
    seen = [[car(10, 0)]] * 9 + [[]] * missed
    assert list(follow([*seen, [car(10, 2.5)]]).id) == [0]
    assert list(follow([*seen, [car(10, 5.5)]]).id) == [1]


def test_a_rotating_sensor_keeps_its_tracks():
    """A parked car seen by a robot that turns at 1 rad/s: its heading in the sensor frame changes in every frame."""
    bearing = np.pi / 4 - 0.1 * np.arange(12)
    r = follow([[car(30 * np.cos(b), 30 * np.sin(b), b)] for b in bearing])
    assert list(r.id) == [0]
    assert_allclose(r.box[0, :2], [30 * np.cos(bearing[-1]), 30 * np.sin(bearing[-1])], atol=0.2)


def test_the_yaw_does_not_flip_by_pi():
    r = follow([[car(10 + i, 0, np.pi * (i % 2))] for i in range(9)])
    assert abs(np.cos(r.box[0, 6])) > 0.99
    assert np.cos(r.box[0, 6]) > 0


def test_a_low_score_continues_a_track_but_starts_none():
    assert len(follow([[car(10, 0)]] * 3, score=-1.0).id) == 0
    tracker = BoxTracker(CONFIG)
    for i, score in enumerate([3.0, -1.0, -1.0]):
        reported = step(tracker, i, [car(10, 0)], score)
    assert list(reported.id) == [0]
    assert list(reported.source) == [0]


def test_a_track_is_reported_by_its_score_or_its_age():
    for frames, score, reported in ((1, 4.5, 0), (1, 5.0, 1), (2, 4.5, 0), (3, 4.5, 1)):
        assert len(follow([[car(10, 0)]] * frames, CONFIDENT, score=score).id) == reported
    tracker = BoxTracker(CONFIDENT)
    ids = [list(step(tracker, i, [car(10, 0)], s).id) for i, s in enumerate([6.0, 1.0, 9.0])]
    assert ids == [[0], [], [0]], "it keeps its id while it is not reported"


@given(st.lists(st.lists(st.tuples(st.floats(-30, 30), st.floats(-30, 30)), max_size=5), max_size=8))
def test_each_detection_has_exactly_one_track(scene):
    tracker = BoxTracker(CONFIG)
    for i, places in enumerate(scene):
        r = step(tracker, i, [car(x, y) for x, y in places])
        assert sorted(r.source) == list(range(len(places)))
        assert len(set(r.id)) == len(r.id)
        assert np.isfinite(r.box).all()


@given(st.integers(0, 2**32 - 1))
def test_prediction_and_update_equal_the_full_kalman_filter(seed):
    rng = np.random.default_rng(seed)
    x = rng.uniform(-50, 50, (1, 4))
    z = rng.uniform(-50, 50, (1, 2))
    variance = rng.uniform(0.01, 4, 1)
    dt_s = rng.uniform(0, 2)
    acceleration = rng.uniform(0.1, 20)
    A = rng.uniform(-2, 2, (2, 2))
    P = A @ A.T + 0.01 * np.eye(2)
    packed = np.array([[P[0, 0], P[0, 1], P[1, 1]]])
    full = np.kron(P, np.eye(2))  # of x, y, vx, vy
    moved, grown = box_tracker.predict(x, packed, acceleration, dt_s)
    after, squeezed = box_tracker.update(x, packed, z, variance)
    F = np.kron([[1, dt_s], [0, 1]], np.eye(2))
    H = np.eye(2, 4)
    push = acceleration * np.kron([[dt_s**2 / 2], [dt_s]], np.eye(2))
    K = full @ H.T @ np.linalg.inv(H @ full @ H.T + variance * np.eye(2))
    assert_allclose(moved[0], F @ x[0], atol=1e-9)
    assert_allclose(after[0], x[0] + K @ (z[0] - H @ x[0]), atol=1e-7)
    for found, expected in ((grown, F @ full @ F.T + push @ push.T), (squeezed, (np.eye(4) - K @ H) @ full)):
        assert_allclose(found[0], expected[[0, 0, 2], [0, 2, 2]], atol=1e-9)


def tracked(rows):
    """Boxes of rows of frame, id, x, yaw and confidence."""
    return np.array(
        [(frame, id_, [x] * 4, [x, 0, -1, 4.0, 1.8, 1.5, yaw], sure) for frame, id_, x, yaw, sure in rows], BOX
    )


def test_gaps_up_to_the_greatest_are_filled_on_the_line_between_their_ends():
    found = tracked([(0, 1, 0.0, 3.0, 4), (3, 1, 6.0, -3.0, 7), (8, 1, 9.0, -3.0, 7), (4, 2, 1.0, 0.0, 5)])
    filled = bridged(found, 3)
    assert filled[["frame", "id"]].tolist() == [(0, 1), (1, 1), (2, 1), (3, 1), (4, 2), (8, 1)]
    assert_allclose(filled["box"][:4, 0], [0, 2, 4, 6])
    assert_allclose(filled["image_box"][:4, 2], [0, 2, 4, 6])
    assert_allclose(filled["confidence"][:4], [4, 5, 6, 7])
    assert (np.cos(filled["box"][:4, 6]) < -0.98).all()  # across pi, not through 0
    assert len(bridged(found, 4)) == len(filled) + 4
    assert len(bridged(found, 0)) == len(found)


def test_of_two_classes_on_one_object_the_more_confident_one_stays_unless_it_only_crosses():
    rows = [(i, number, x, 0, sure) for number, x, sure in ((1, 10, 4), (2, 10.5, 6), (4, 30, 3)) for i in range(4)]
    found = tracked(rows)
    assert set(of_one_class(found, found["id"] % 3)["id"]) == {2, 4}
    assert set(of_one_class(found, np.zeros(len(rows)))["id"]) == {1, 2, 4}
    crossing = tracked([(i, 1, 10 + 3 * i, 0, 4) for i in range(6)] + [(i, 2, 10, 0, 6) for i in range(6)])
    assert set(of_one_class(crossing, crossing["id"])["id"]) == {1, 2}


def test_overlap_of_volumes():
    a = np.array([[0, 0, 0, 4, 2, 1.5, 0.3]])
    moved = [[0, 0, 0], [0, 0, 0.5], [9, 0, 0], [0, 0, 2.0], [4 * np.cos(0.3) / 2, 4 * np.sin(0.3) / 2, 0]]
    b = np.array([a[0] + [*step, 0, 0, 0, 0] for step in moved])
    assert_allclose(iou_3d(np.repeat(a, len(b), axis=0), b), [1, 1 / 2, 0, 0, 1 / 3], atol=1e-9)
