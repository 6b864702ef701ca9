"""Lower bounds on real scans; docs/segmentation.md has the measured values."""

import numpy as np
import pytest

from modt import profile
from modt.classes import ObjectClass
from modt.segmentation.grids import PointColumns
from modt.segmentation.ground import GroundEstimator
from tools.study.segmentation_recall import Tally
from tools.train.labelled_scans import folder_scans

pytestmark = pytest.mark.kitti

GROUND = (40, 44, 48, 49, 60, 72)
UNKNOWN = (0, 1)
GROUND_TOLERANCE_M = 0.15


@pytest.mark.slow
def test_labelled_objects_are_found(kitti_root):
    tally = Tally()
    for scan in folder_scans(kitti_root / "object" / "training", "hdl-64e", profile.load("hdl-64e")):
        tally.add(scan)
    recall = tally.detected / np.maximum(tally.objects, 1)
    assert recall[ObjectClass.CAR] > 0.94
    assert recall[ObjectClass.PEDESTRIAN] > 0.9
    assert recall[ObjectClass.CYCLIST] > 0.95


def test_ground_agrees_with_the_semantic_labels(kitti_root):
    settings, sequence = profile.load("hdl-64e"), kitti_root / "odometry" / "00"
    ground = GroundEstimator(settings.sensor, settings.segmentation.max_slope_deg)
    for path in sorted((sequence / "labels").glob("*.label")):
        kind = np.fromfile(path, np.uint32) & 0xFFFF
        points = np.fromfile(sequence / "velodyne" / f"{path.stem}.bin", np.float32).reshape(-1, 4)
        low = ground.height_above(PointColumns.from_array(points), 1.73) < GROUND_TOLERANCE_M
        known, true = ~np.isin(kind, UNKNOWN), np.isin(kind, GROUND)
        both = (low & true & known).sum()
        assert 2 * both / ((low & known).sum() + (true & known).sum()) > 0.96
