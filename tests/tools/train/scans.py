"""Simulated scans of training in tests."""

import numpy as np

from modt.segmentation.segmenter import Segmenter
from modt_training.crop_writer import label


def labels_of(scan):
    """Labels of the proposals of a scan."""
    return label(scan, Segmenter(scan.profile.segmentation, scan.profile.sensor, scan.fov).segment(scan.points))


def assert_same(first, second):
    """Two runs of a generator give the same points."""
    for a, b in zip(first, second, strict=True):
        np.testing.assert_array_equal(a.points, b.points)
