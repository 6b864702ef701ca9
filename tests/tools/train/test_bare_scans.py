"""Simulated sweeps without objects."""

import numpy as np

from modt.segmentation.segmenter import Segmenter
from modt_training.crop_writer import label
from tools.train.bare_scans import bare_scans

SENSORS = ("vlp-16", "mid-360")


def test_a_bare_sweep_has_proposals_and_no_object():
    for scan in bare_scans([1, 2], SENSORS):
        assert scan.kinds == ()
        proposals = Segmenter(scan.profile.segmentation, scan.profile.sensor, scan.fov).segment(scan.points)
        labels = label(scan, proposals)
        assert len(proposals)
        assert not labels.kind.any()
        assert not labels.unknown.any()


def test_a_bare_sweep_is_the_same_whenever_it_is_made():
    first, second = (list(bare_scans([7, 8], SENSORS)) for _ in range(2))
    for a, b in zip(first, second, strict=True):
        np.testing.assert_array_equal(a.points, b.points)
