"""Lower bounds on real scans; docs/segmentation.md has the measured values."""

import numpy as np
import pytest

from modt import profile
from modt.geometry import Camera, FieldOfView, inverse, se3, transform
from modt.segmentation.grids import PointColumns
from modt.segmentation.ground import GroundEstimator
from modt.segmentation.segmenter import Segmenter

pytestmark = pytest.mark.kitti

GROUND = (40, 44, 48, 49, 60, 72)
UNKNOWN = (0, 1)
GROUND_TOLERANCE_M = 0.15


def object_frames(folder):
    """Points, view, and (kind, mask) of each object with 20 points or more clear of the ground."""
    for path in sorted((folder / "velodyne").glob("*.bin")):
        lines = (folder / "calib" / f"{path.stem}.txt").read_text().splitlines()
        value = {k: np.array(v.split(), float) for k, v in (t.split(":") for t in lines if ":" in t)}
        T = se3(value["R0_rect"].reshape(3, 3), np.zeros(3)) @ np.vstack(
            [value["Tr_velo_to_cam"].reshape(3, 4), [0, 0, 0, 1]]
        )
        points = np.fromfile(path, np.float32).reshape(-1, 4)
        objects = []
        for line in (folder / "label_2" / f"{path.stem}.txt").read_text().splitlines():
            kind, *text = line.split()
            height, width, length, *centre, turn = (float(t) for t in text[7:14])
            foot = transform(inverse(T), np.array([centre]))[0]
            c, s = np.cos(-turn - np.pi / 2), np.sin(-turn - np.pi / 2)
            x, y, z = (points[:, i] - foot[i] for i in range(3))
            inside = (np.abs(c * x + s * y) < length / 2 + 0.15) & (np.abs(c * y - s * x) < width / 2 + 0.15)
            inside &= (z > 0.25) & (z < height + 0.15)
            if inside.sum() >= 20:
                objects.append((kind, inside))
        yield points, FieldOfView.of_camera(Camera(value["P2"].reshape(3, 4) @ T, T, 1242.0, 375.0)), objects


def found(label, inside):
    """Whether one proposal has an IoU above 0.5 with the points of an object."""
    shared = np.bincount(label[inside] + 1, minlength=1)
    shared[0] = 0
    best = int(shared.argmax())
    union = (label == best - 1).sum() + inside.sum() - shared[best]
    return bool(shared[best] > 0.5 * union)


@pytest.mark.slow
def test_labelled_objects_are_found(kitti_root):
    settings = profile.load("hdl-64e")
    hits = {kind: [] for kind in ("Car", "Van", "Pedestrian", "Cyclist")}
    for points, view, objects in object_frames(kitti_root / "object" / "training"):
        stage = Segmenter(settings.segmentation, settings.sensor, view)
        label = stage.segment(points).label(len(points))
        for kind, inside in objects:
            if kind in hits:
                hits[kind].append(found(label, inside))
    recall = {kind: np.mean(values) for kind, values in hits.items()}
    assert recall["Car"] > 0.94
    assert recall["Van"] > 0.94
    assert recall["Pedestrian"] > 0.84
    assert recall["Cyclist"] > 0.95


def test_ground_agrees_with_the_semantic_labels(kitti_root):
    settings = profile.load("hdl-64e")
    ground = GroundEstimator(settings.sensor, settings.segmentation.max_slope_deg)
    for path in sorted((kitti_root / "odometry" / "00" / "labels").glob("*.label")):
        kind = np.fromfile(path, np.uint32) & 0xFFFF
        points = np.fromfile(kitti_root / "odometry" / "00" / "velodyne" / f"{path.stem}.bin", np.float32).reshape(
            -1, 4
        )
        low = ground.height_above(PointColumns.from_array(points), 1.73) < GROUND_TOLERANCE_M
        known, true = ~np.isin(kind, UNKNOWN), np.isin(kind, GROUND)
        both = (low & true & known).sum()
        assert 2 * both / ((low & known).sum() + (true & known).sum()) > 0.96
