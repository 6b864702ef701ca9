"""Recall of the segmentation."""

import numpy as np

from modt.classes import ObjectClass
from tools.study.segmentation_recall import Tally
from tools.train.synthetic_scans import simulated_scans


def test_objects_of_a_scan_are_counted_by_class():
    (scan,) = simulated_scans(["street"], [3], [0.0], camera=False, sensors=["vlp-16"])
    tally = Tally()
    tally.add(scan)
    visible = [k for k, own in zip(scan.kinds, scan.objects, strict=True) if len(own) >= 20]
    assert tally.objects.tolist() == np.bincount(visible, minlength=4).tolist()
    assert tally.objects[ObjectClass.CAR] > 3
    assert tally.detected[ObjectClass.CAR] > 0.5 * tally.objects[ObjectClass.CAR]
    assert (tally.detected <= tally.objects).all()
    assert tally.row("x").startswith("| x | ")
