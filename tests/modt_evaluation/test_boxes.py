"""Errors of boxes and velocities, average precision in 3D, and the reaction."""

from dataclasses import replace

import numpy as np
import pytest

from modt_evaluation.box_score import average_precision
from modt_evaluation.boxes import aligned_iou, greedy_pairs
from modt_evaluation.rows import REPORTED, table
from modt_evaluation.rules import KITTI_ALL_ROUND_RULES
from tests.modt_evaluation.scenes import blob, car, cars, frame, score


def driven(boxes, *, index=0, x=10.0, name="car", velocity=(0.0, 0.0), n=30):
    """A frame with one car at x and a track whose boxes are given."""
    tracks = [(7 + k, 0, name) for k in range(len(boxes))]
    made = frame(cars(x), [(blob(n, x), 0)], tracks, index=index)
    return replace(made, box=np.array(boxes), velocity=np.array([velocity] * len(boxes)), stamp_s=index / 10)


def test_errors_of_a_box():
    box = np.add(car(10.0), [0.3, 0.4, 0.0, 0.0, 0.0, 0.0, np.pi - 0.1])
    box[3] = 3.0
    found = score([driven([box])]).boxes["car"]
    assert found.matched == 1
    assert found.translation_m == pytest.approx(0.5)
    assert found.scale == pytest.approx(0.25)
    assert found.orientation_rad == pytest.approx(np.pi - 0.1)
    assert found.axis_rad == pytest.approx(0.1)
    assert found.velocity_mps is None  # one frame has no velocity


@pytest.mark.parametrize(("name", "shift_m", "matched"), [("car", 1.99, 1), ("car", 2.01, 0), ("pedestrian", 0.0, 0)])
def test_a_box_stands_for_one_of_its_class_within_two_metres(name, shift_m, matched):
    found = score([driven([car(10.0 + shift_m)], name=name)]).boxes
    assert found["car"].matched == matched
    assert found["pedestrian"].matched == 0


def test_velocity_is_judged_by_the_displacement_of_the_labels():
    frames = [driven([car(10 + 0.5 * k)], index=k, x=10 + 0.5 * k, velocity=(4.0, 0.0)) for k in range(6)]
    found = score(frames).boxes["car"]
    assert (found.matched, found.moving) == (6, 6)
    assert found.velocity_mps == found.velocity_moving_mps == pytest.approx(1.0)
    still = score([driven([car(10.0)], index=k) for k in range(6)]).boxes["car"]
    assert (still.moving, still.velocity_moving_mps) == (0, None)
    assert still.velocity_mps == pytest.approx(0.0)


def test_pairs_are_the_nearest_first_and_each_is_used_once():
    cost = np.array([[1.0, 0.5], [0.2, 0.1]])
    rows, columns = greedy_pairs(cost, np.ones((2, 2), np.bool_))
    assert list(zip(rows.tolist(), columns.tolist(), strict=True)) == [(1, 1), (0, 0)]
    assert not len(greedy_pairs(cost, np.zeros((2, 2), np.bool_))[0])


def test_aligned_boxes_share_their_smaller_sides():
    assert aligned_iou(np.array([[4.0, 2.0, 1.0]]), np.array([[2.0, 2.0, 2.0]]))[0] == pytest.approx(4 / 12)


def reported(*rows):
    """Rows of reported objects: score, IoU, whether that object is judged, whether it is judged where it has none."""
    made = table(REPORTED, len(rows))
    for name, column in zip(("score", "iou", "iou_judged", "to_report"), zip(*rows, strict=True), strict=True):
        made[name] = column
    return made


def test_average_precision_of_boxes():
    pytest.importorskip("shapely")
    right, wrong = (0.8, True, True), (0.4, True, True)
    assert average_precision(reported((0.9, *right), (0.8, *right)), 0.7, 2) == pytest.approx(1.0)
    assert average_precision(reported((0.9, *right), (0.8, *wrong)), 0.7, 2) == pytest.approx(0.5)
    assert average_precision(reported((0.9, *wrong), (0.8, *right)), 0.7, 1) == pytest.approx(0.5)
    assert average_precision(reported((0.9, *right), (0.95, 0.8, False, True)), 0.7, 1) == pytest.approx(1.0)
    assert average_precision(reported((0.9, *right), (0.95, 0.0, False, False)), 0.7, 1) == pytest.approx(1.0)
    assert average_precision(reported((0.9, *right)), 0.7, 0) is None


def test_average_precision_of_a_drive():
    pytest.importorskip("shapely")
    found = score([driven([car(10.4)], index=k) for k in range(3)], KITTI_ALL_ROUND_RULES).boxes["car"]
    assert (found.strict_ap, found.loose_ap) == (pytest.approx(1.0), pytest.approx(1.0))
    found = score([driven([car(11.0)], index=k) for k in range(3)], KITTI_ALL_ROUND_RULES).boxes["car"]
    assert (found.strict_ap, found.loose_ap) == (pytest.approx(0.0), pytest.approx(1.0))


def test_reaction_counts_from_the_first_twenty_points():
    points = [10, 10, 20, 25, 25, *[30] * 20]
    names = [*["background"] * 4, *["car"] * 21]
    frames = [driven([car(10.0)], index=k, name=names[k], n=n) for k, n in enumerate(points)]
    found = score(frames).reaction["car"]
    assert (found.entered, found.median_frames, found.never, found.at_start) == (1, 2.0, 0, 0)
    found = score(frames[2:]).reaction["car"]
    assert (found.entered, found.at_start, found.at_start_median_frames) == (0, 1, 2.0)
    unseen = score([driven([car(10.0)], index=k, name="background", n=n) for k, n in enumerate(points)])
    assert (unseen.reaction["car"].never, unseen.reaction["car"].median_frames) == (1, None)
