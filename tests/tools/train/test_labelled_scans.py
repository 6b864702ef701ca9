"""Readers of labelled scans, and scenes made from label files."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from modt.classes import ObjectClass
from modt.config import SensorConfig
from modt.errors import MisuseError
from modt_simulation.synthetic_stream import K
from modt_training.simulated import simulated_scans
from tests.tools.train.datasets import scan_of, write_folder
from tools.train.labelled_scans import AT_SENSOR, argoverse_scans, beams, folder_scans, pandaset_scans, thinned
from tools.train.synthetic_scans import label_scene


def test_argoverse_sweeps_are_in_the_sensor_frame(tmp_path):
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
    assert_allclose(scan.points[1, :3], [10.0, 0.0, -1.07], atol=1e-5)
    assert_allclose(scan.boxes[0, :3], [10.15, 0.5, -1.92], atol=1e-5)
    assert len(scan.objects[0]) == 30


def pandaset(folder, name, points, rows):
    """The scan of points [m, world] and rows of a table of labels."""
    (folder / "scans").mkdir()
    np.c_[points, np.full(len(points), 9)].astype(np.float32).tofile(folder / "scans" / f"{name}.bin")
    (folder / f"{name}.csv").write_text(f"class,x,y,z,length,width,height,yaw,points\n{rows}")
    (scan,) = pandaset_scans(folder)
    return scan


def test_pandaset_scans_are_in_the_sensor_frame_and_types_between_the_classes_unlabelled(tmp_path):
    feet = np.array([[10.79, 0.0], [20.79, 0.0], [30.79, 0.0], [40.79, 0.0]])
    points = np.c_[np.repeat(feet, 25, axis=0), np.tile(np.linspace(0.3, 1.1, 25), 4)]
    rows = "Pedestrian_with_Object,10.79,0,0.6,0.8,0.8,1.9,0,25\nMedium-sized_Truck,20.79,0,0.6,7,2.5,1.9,0,25\n"
    rows += "Bicycle,30.79,0,0.6,1.8,0.6,1.8,0,25\nBicycle,40.79,0,0.6,1.8,0.6,1.2,0,25\n"
    scan = pandaset(tmp_path, "000001", points, rows)
    assert scan.sensor == "pandar64"
    assert scan.kinds == (ObjectClass.PEDESTRIAN, ObjectClass.CYCLIST, ObjectClass.BACKGROUND)
    assert_allclose(scan.boxes[:, :3], [[10, 0, -2.2], [30, 0, -2.15], [40, 0, -1.85]], atol=1e-6)
    assert [len(own) for own in scan.objects] == [25, 25, 25]
    assert np.flatnonzero(scan.unlabelled).tolist() == list(range(25, 50))


def test_cars_of_pandaset_are_turned_to_their_points_and_people_without_a_label_unknown(tmp_path):
    side = np.linspace(-2.0, 2.0, 41)
    height = np.full(41, 1.6)
    across = np.c_[np.full(41, -20.0), 30.0 + side, height]  # sensor at (-30, 34.1, 1.79)
    along = np.c_[-10.0 + side, np.full(41, 30.0), height]
    people = np.array([[-20.0, 51.6, 1.6], [-21.3, 51.4, 1.6], [-20.0, 55.0, 1.6]])
    rows = "".join(f"Car,{x},30,1.2,4.4,1.8,1.5,0,41\n" for x in (-20, -10))
    scan = pandaset(tmp_path, "world-000040", np.concatenate([across, along, people]), rows)
    assert_allclose(scan.boxes[:, 6], [np.pi / 2, 0.0])
    assert [len(own) for own in scan.objects] == [41, 41]
    assert np.flatnonzero(scan.unlabelled).tolist() == [82, 83]


def test_a_thinned_scan_has_every_second_beam_and_the_objects_of_the_whole():
    azimuth = np.arange(0.1, 2 * np.pi, 0.1)
    rho = np.repeat([20.0, 15.0, 10.0, 5.0], len(azimuth))  # beam by beam, from the top
    a = np.tile(azimuth, 4)
    points = np.c_[rho * np.cos(a), rho * np.sin(a), np.full(len(a), -1.7), np.zeros(len(a))].astype(np.float32)
    assert beams(points).tolist() == np.repeat(np.arange(4), len(azimuth)).tolist()
    here = np.flatnonzero(np.abs(a - 1.0) < 0.25)
    scan = thinned(scan_of(points, [here], [ObjectClass.CAR], np.arange(len(a)) < 5), 2)
    assert set(np.hypot(scan.points[:, 0], scan.points[:, 1]).round()) == {20, 10}
    assert (scan.points[scan.objects[0]] == points[here[(rho[here] == 20) | (rho[here] == 10)]]).all()
    assert scan.unlabelled.sum() == 5
    assert scan.profile.sensor.elevation_step_deg == 2 * SensorConfig().elevation_step_deg
    assert scan.sensor == "hdl-64e, 32 beams"


def test_scans_in_a_folder_are_those_that_were_written(tmp_path):
    made = list(simulated_scans(["street"], [3], [0.0, 0.5], camera=False, sensors=["vlp-16"]))
    write_folder(tmp_path, made)
    found = list(folder_scans(tmp_path, "mine", made[0].profile))
    assert [scan.drive for scan in found] == ["street-3", "street-3"]
    for scan, original in zip(found, made, strict=True):
        assert (scan.sensor, scan.profile) == ("mine", original.profile)
        assert (scan.points == original.points).all()
        assert scan.fov.full
        shown = [k for k, kind in enumerate(original.kinds) if kind]
        assert scan.kinds == tuple(original.kinds[k] for k in shown)
        off = scan.boxes - original.boxes[shown]
        off[:, 6] = np.sin(off[:, 6] / 2)
        assert np.abs(off).max() < 0.01
    with pytest.raises(MisuseError, match="no scans"):
        next(folder_scans(tmp_path / "label_2", "mine", made[0].profile))
    (tmp_path / "label_2" / "street-3_000001.txt").unlink()
    with pytest.raises(MisuseError, match="street-3_000001"):
        list(folder_scans(tmp_path, "mine", made[0].profile))


def test_the_calibration_of_a_folder_states_where_labels_are_complete(tmp_path):
    (scan,) = simulated_scans(["street"], [3], [0.0], camera=True, sensors=["vlp-16"])
    write_folder(tmp_path, [scan])
    (tmp_path / "calib").mkdir()
    lines = {
        "P2": np.c_[K[:, :3], np.zeros(3)],
        "R0_rect": np.eye(3),
        "Tr_velo_to_cam": AT_SENSOR.T_camera_sensor[:3],
    }
    text = "".join(f"{key}: {' '.join(map(str, value.ravel()))}\n" for key, value in lines.items())
    (tmp_path / "calib" / "street-3_000000.txt").write_text(text)
    (found,) = folder_scans(tmp_path, "mine", scan.profile)
    seen = found.fov.depth(found.points) > 0
    assert 0.1 < seen.mean() < 0.4
    assert (found.unlabelled == ~seen).all()


def test_objects_of_a_label_file_stand_where_it_states(tmp_path):
    path = tmp_path / "000000.txt"
    path.write_text(
        "Car 0 0 0 0 0 9 9 1.5 1.6 4.0 2.0 1.7 15.0 -1.57\n"
        "Pedestrian 0 0 0 0 0 9 9 1.8 0.6 0.8 -3.0 1.7 9.0 0.3\n"
        "Cyclist 0 0 0 0 0 9 9 1.7 0.6 1.8 6.0 1.7 12.0 1.2\n"
        "DontCare -1 -1 -10 5 5 9 9 -1 -1 -1 -1000 -1000 -1000 -10\n"
    )
    _, truth = label_scene(path, seed=0).sweep(0)
    assert [k.name for k in truth.kinds] == ["Car", "Pedestrian", "Cyclist"]
    assert_allclose(truth.boxes[0, [0, 1, 3, 4, 5]], [15.27, -2.0, 4.0, 1.6, 1.5], atol=0.1)
    assert_allclose(truth.boxes[1, :2], [9.27, 3.0], atol=0.1)
    assert (truth.points > 50).all()
