"""Scores of classes and of tracks."""

import sys

import numpy as np
import pytest

from modt.types import NONE
from modt_evaluation.class_score import expected_calibration_error, top_calibration_error
from modt_evaluation.evaluation import collect, evaluation
from modt_evaluation.rows import Association
from modt_evaluation.rules import KITTI_RULES
from modt_evaluation.track_score import track_metrics
from modt_evaluation.truth import KITTI_TYPES, FrameTruth
from tests.modt_evaluation.scenes import blob, car, cars, frame, score


def posterior(car):
    return [1 - car, car, 0.0, 0.0]


def test_average_precision_precision_and_recall():
    blobs = [(blob(30, x), k) for k, x in enumerate((10, 18, 26, 34))]
    tracks = [(k, k, name) for k, name in enumerate(("car", "background", "car", "background"))]
    scene = frame(cars(10, 18, 42), blobs, tracks, posteriors=np.array([posterior(p) for p in (0.9, 0.5, 0.7, 0.2)]))
    found = score([scene]).ranges["all"].classification["car"]
    assert (found.objects, found.called, found.segmentable) == (2, 2, 2)  # nothing is seen of the third
    assert found.average_precision == pytest.approx(1 / 2 + 2 / 3 / 2)
    assert found.curve == ((0.9, 1.0, 0.5), (0.5, pytest.approx(2 / 3), 1.0))
    assert (found.precision, found.recall, found.recall_of_found) == (0.5, 0.5, 0.5)


def test_an_object_that_is_not_segmented_is_missed_by_every_recall():
    missed = frame(cars(10, 18), [(blob(30, 10), 0), (blob(30, 18), -1)], [(0, 0, "car")])
    ranges = score([missed]).ranges["all"]
    found = ranges.classification["car"]
    assert (ranges.segmentation["car"].objects, ranges.segmentation["car"].recall) == (2, 0.5)
    assert (found.average_precision, found.recall, found.recall_of_found, found.precision) == (0.5, 0.5, 1.0, 1.0)


def test_bands_of_range_go_by_the_object():
    truth = FrameTruth.of(KITTI_TYPES, [0, 1], ["Car", "Pedestrian"], [car(19.9), car(45.0)])
    scene = frame(truth, [(blob(30, 20.3), 0), (blob(30, 45), 1)], [(0, 0, "car"), (1, 1, "pedestrian")])
    ranges = score([scene]).ranges
    assert ranges["0-20"].classification["car"].average_precision == 1
    assert ranges["20-40"].classification["car"].objects == 0
    assert ranges["20-40"].classification["car"].average_precision is None
    assert ranges["40-60"].classification["pedestrian"].recall == 1
    assert set(ranges["40-60"].segmentation) == {"pedestrian", "Pedestrian"}


def test_calibration():
    assert expected_calibration_error(np.array([0.9, 0.9, 0.1]), np.array([True, False, False])) == pytest.approx(0.3)
    assert expected_calibration_error(np.zeros(0), np.zeros(0, np.bool_)) is None
    sure = np.array([posterior(1.0), posterior(1.0), posterior(0.0)])
    assert top_calibration_error(sure, np.array([1, 1, 0])) == 0
    assert top_calibration_error(sure, np.array([1, 0, 0])) == pytest.approx(1 / 3)


PLACES = (10.0, 20.0)


def followed(*histories, points=30):
    """Frames with two cars and the tracks that follow each of them: None for a miss, '-' where it is not labelled."""
    frames = []
    for index, tracks in enumerate(zip(*histories, strict=True)):
        shown = [k for k, track in enumerate(tracks) if track != "-"]
        truth = FrameTruth.of(KITTI_TYPES, shown, ["Car"] * len(shown), [car(PLACES[k]) for k in shown])
        seen = [k for k in shown if tracks[k] is not None]
        blobs = [(blob(points, PLACES[k]), seen.index(k) if k in seen else NONE) for k in shown]
        frames.append(frame(truth, blobs, [(tracks[k], i, "car") for i, k in enumerate(seen)], index=index))
    return frames


def tracked(*histories, **more):
    return score(followed(*histories, **more)).tracks["all"]


def test_misses_count_as_misses():
    found = tracked([1, 1, None, 1, "-"], [None] * 5)
    assert (found.life.objects, found.life.frames) == (2, 9)
    assert (found.life.life, found.life.ideal) == (1.5, 4.5)
    assert found.life.ratio == pytest.approx(1 / 3)
    assert (found.life_as_seen.objects, found.life_as_seen.life, found.life_as_seen.ideal) == (1, 3, 3)
    assert found.followed == pytest.approx(1 / 3)
    assert found.discontinuities == 0


def test_discontinuities_and_where_the_next_track_comes_from():
    found = tracked([1, 1, 2, 2, 1, 3], [3, 3, 3, 3, 3, 3])
    assert (found.discontinuities, found.returned, found.taken_over) == (3, 1, 1)
    assert found.life.life == 12 / (2 + 3)


def test_labelled_frames_count_whatever_points_they_have():
    found = tracked([1, 1], [2, "-"], points=9)
    assert (found.life.objects, found.life.life) == (0, None)
    assert (found.labelled.objects, found.labelled.ideal) == (2, 1.5)


def test_objects_without_identity_have_no_life():
    truth = FrameTruth.of(KITTI_TYPES, [NONE], ["Car"], [car(10.0)])
    found = score([frame(truth, [(blob(30, 10), 0)], [(1, 0, "car")])])
    assert (found.tracks, found.metrics) == ({}, None)


def test_drives_are_pooled_and_their_identities_kept_apart():
    one = followed([1, 1, 1], ["-"] * 3)
    two = followed([2, 2, 2], ["-"] * 3)
    found = evaluation([collect(f, KITTI_RULES, k) for k, f in enumerate((one, two))])
    assert (found.drives, found.frames, found.tracks["all"].life.objects) == (2, 6, 2)
    assert found.tracks["all"].discontinuities == 0
    assert found.metrics["car"]["HOTA"] == pytest.approx(1)


def association(truth, tracks, similarity=1.0):
    return Association(np.array(truth), np.array(tracks), similarity * np.eye(len(truth), len(tracks)))


def test_a_switch_costs_association_only():
    found = track_metrics([[association([5], [1 if i < 5 else 2]) for i in range(10)]])
    assert found["id_switches"] == 1
    assert found["DetA"] == pytest.approx(1)
    assert found["AssA"] == pytest.approx(0.5)
    assert found["MOTA"] == pytest.approx(0.9)


def test_without_the_extra_the_rest_is_there(monkeypatch):
    monkeypatch.setitem(sys.modules, "trackeval", None)
    found = score([frame(cars(10.0), [(blob(30, 10), 0)], [(1, 0, "car")])])
    assert found.metrics is None
    assert found.tracks["car"].life.life == 1
