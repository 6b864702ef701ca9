"""Simulated roads with rows of parked two-wheelers, riders and people."""

import numpy as np

from modt.classes import ObjectClass
from modt.segmentation.segmenter import Segmenter
from modt_training.crop_writer import label
from tools.train.rider_scans import rider_scans

SENSORS = ("os1-128", "pandar64")


def test_a_road_has_riders_people_and_rows():
    for scan in rider_scans([1, 2], SENSORS):
        assert {ObjectClass.PEDESTRIAN, ObjectClass.CYCLIST} <= set(scan.kinds)
        proposals = Segmenter(scan.profile.segmentation, scan.profile.sensor, scan.fov).segment(scan.points)
        labels = label(scan, proposals)
        assert (labels.kind == ObjectClass.CYCLIST).any()
        assert (labels.majority == ObjectClass.BACKGROUND).any()


def test_a_road_is_the_same_whenever_it_is_made():
    first, second = (next(rider_scans([7], SENSORS)) for _ in range(2))
    np.testing.assert_array_equal(first.points, second.points)
