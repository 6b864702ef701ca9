"""Simulated roads with rows of parked two-wheelers, riders and people."""

from itertools import islice

from modt.classes import ObjectClass
from tests.tools.train.scans import assert_same, labels_of
from tools.train.rider_scans import rider_scans

SENSORS = ("os1-128", "pandar64")


def test_a_road_has_riders_people_and_rows():
    for scan in rider_scans([1, 2], SENSORS):
        assert {ObjectClass.PEDESTRIAN, ObjectClass.CYCLIST} <= set(scan.kinds)
        labels = labels_of(scan)
        assert (labels.kind == ObjectClass.CYCLIST).any()
        assert (labels.majority == ObjectClass.BACKGROUND).any()


def test_a_road_is_the_same_whenever_it_is_made():
    assert_same(*(islice(rider_scans([7], SENSORS), 1) for _ in range(2)))
