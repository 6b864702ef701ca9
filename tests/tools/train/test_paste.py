"""Copy-paste augmentation."""

import numpy as np
import pytest

from modt.classes import ObjectClass
from tests.tools.train.datasets import scan_of
from tools.train.paste import ObjectCut, paste_objects


def test_a_pasted_object_stands_on_the_ground_and_occludes_the_scene():
    rng = np.random.default_rng(0)
    azimuth, elevation = np.meshgrid(np.arange(-180, 180, 0.4), np.arange(-24, -1, 0.8))
    rho = 1.7 / np.tan(np.deg2rad(-elevation.ravel()))
    a = np.deg2rad(azimuth.ravel())
    ground = np.c_[rho * np.cos(a), rho * np.sin(a), np.full(len(a), -1.7), np.zeros(len(a))].astype(np.float32)
    body = np.c_[np.full(60, 12.0), rng.uniform(-0.3, 0.3, 60), rng.uniform(-1.6, 0, 60), np.zeros(60)]
    box = np.array([12.0, 0, -1.7, 0.8, 0.8, 1.8, 0])
    cuts = [ObjectCut(body.astype(np.float32), box, kind, "there") for kind in list(ObjectClass)[1:]]
    empty = scan_of(ground, [], [], np.zeros(len(ground), np.bool_))
    made = list(paste_objects(empty, cuts, 8, rng))
    assert made
    scan = made[0]
    assert scan.drive == "there"
    assert len(scan.points) < len(ground) + sum(map(len, scan.objects))
    for own, box in zip(scan.objects, scan.boxes, strict=True):
        assert np.hypot(*scan.points[own, :2].T) == pytest.approx(np.hypot(*box[:2]), abs=1.0)
        assert not scan.unlabelled[own].any()
    assert scan.unlabelled.sum() == len(scan.points) - sum(map(len, scan.objects))
