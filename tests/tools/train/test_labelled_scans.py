"""Readers of labelled scans."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from modt.classes import ObjectClass
from tools.train.labelled_scans import argoverse_scans, points_in_box


def test_argoverse_sweeps_are_in_the_sensor_frame(tmp_path: Path) -> None:
    car = np.array([11.35, 0.0, 0.5, 0.2], np.float32) + np.linspace(0, 1, 30)[:, None] * np.float32([0, 1, 0, 0])
    carrier = np.array([[1.4, 0.1, 1.0, 0.2]], np.float32)
    np.savez(tmp_path / "log_1.npz", points=np.concatenate([carrier, car]))
    (tmp_path / "log_1.csv").write_text(
        "category,track,x_m,y_m,z_centre_m,length_m,width_m,height_m,yaw_rad,points\n"
        "REGULAR_VEHICLE,a,11.5,0.5,0.4,4.0,1.8,1.5,1.57,30\n"
        "BICYCLE,b,5.0,5.0,0.4,1.6,0.6,1.1,0.0,9\n"
        "PEDESTRIAN,c,60.0,5.0,0.4,0.6,0.6,1.7,0.0,0\n"
    )
    (scan,) = argoverse_scans(tmp_path)
    assert scan.kinds == (ObjectClass.CAR, ObjectClass.BACKGROUND)
    assert scan.drive == "argoverse2/log"
    np.testing.assert_allclose(scan.points[0, :3], [10.0, 0.0, -0.9], atol=1e-5)
    np.testing.assert_allclose(scan.boxes[0, :3], [10.15, 0.5, -1.75], atol=1e-5)
    assert len(scan.objects[0]) == 30


def test_points_in_a_rotated_box_are_above_the_ground() -> None:
    box = np.array([10.0, 0.0, -1.7, 4.0, 2.0, 1.5, np.pi / 2])
    points = np.array([[10, 1.9, -1, 0], [11.9, 0, -1, 0], [10, 0, -1.6, 0], [10, 0, 0.5, 0]], np.float32)
    assert points_in_box(points, box).tolist() == [True, False, False, False]
