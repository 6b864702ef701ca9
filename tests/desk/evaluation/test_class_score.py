import numpy as np
import pytest

from modt_desk.evaluation.class_score import expected_calibration_error, top_calibration_error
from modt_desk.evaluation.truth import KITTI_TYPES, FrameTruth
from tests.desk.evaluation.scenes import blob, car, cars, frame, score


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
