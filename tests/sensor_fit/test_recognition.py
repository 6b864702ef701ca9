"""Profiles against the first sweep."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modt import profile
from modt.sensor_fit.recognition import recognise
from modt.sources.scan_file import read_scan
from modt_simulation.sensors import SENSORS
from tests.sensor_fit.recordings import recording, with_scale


@pytest.mark.slow
@pytest.mark.parametrize("name", SENSORS)
def test_a_sensor_fits_its_profile(name):
    config = profile.load(name)
    found = recognise(recording(name).sweeps[0], config)
    assert found.differences == ()
    assert found.fitted == config


@pytest.mark.parametrize("name", [name for name in SENSORS if name != "hdl-64e"])
def test_another_sensor_than_the_default_is_noticed_and_named(name):
    found = recognise(recording(name).sweeps[0], profile.load())
    assert found.differences
    assert found.nearest == name
    line = next(found.warnings("hdl-64e", replaced=True))
    assert all(part in line for part in ("hdl-64e", f"--profile {name}", "modt profile fit"))


def test_what_is_found_takes_the_place_of_the_profile():
    own = profile.load("vlp-16")
    found = recognise(recording("vlp-16").sweeps[0], profile.load()).fitted
    assert found.sensor.elevation_step_deg == pytest.approx(own.sensor.elevation_step_deg, rel=0.02)
    assert found.sensor.azimuth_step_deg == pytest.approx(own.sensor.azimuth_step_deg, rel=0.02)
    assert found.sensor.height_m == pytest.approx(own.sensor.height_m, abs=0.15)
    assert found.sensor.min_range_m <= found.sensor.height_m
    assert found.sensor.reflectance == "none"
    assert found.segmentation.cell_m > profile.load().segmentation.cell_m
    assert found.fusion == own.fusion  # not those that rest on reflectance


def test_the_scale_of_the_reflectance_is_found_too():
    found = recognise(with_scale(recording("pandar64"), "pandar64").sweeps[0], profile.load())
    assert found.nearest == found.fitted.sensor.reflectance == "pandar64"
    assert any("reflectance" in difference for difference in found.differences)


def test_another_mount_changes_the_height_alone():
    own = profile.load()
    lower = dataclasses.replace(own, sensor=dataclasses.replace(own.sensor, height_m=1.0))
    found = recognise(recording("hdl-64e").sweeps[0], lower)
    assert len(found.differences) == 1
    assert found.fitted.sensor.height_m == pytest.approx(1.73, abs=0.1)
    assert found.fitted == dataclasses.replace(own, sensor=found.fitted.sensor)
    assert "another mount" in next(found.warnings("hdl-64e", replaced=True))


def test_few_points_fit_any_profile():
    points = np.random.default_rng(0).uniform(-20, 20, (500, 4)).astype(np.float32)
    assert recognise(points, profile.load()).differences == ()


@pytest.mark.slow
@given(st.integers(0, 2**32 - 1), st.integers(0, 8_000), st.floats(1e-3, 200.0), st.floats(1e-3, 200.0))
@settings(max_examples=15)
def test_any_cloud_is_recognised_or_not_but_no_error(seed, n, reach_m, rise_m):
    points = np.random.default_rng(seed).normal(0, 1, (n, 4)).astype(np.float32) * [reach_m, reach_m, rise_m, 0]
    found = recognise(points.astype(np.float32), profile.load())
    assert found.fitted == profile.load() or found.differences


@pytest.mark.kitti
def test_every_kitti_scan_is_of_the_default(kitti_root):
    objects = "object/training*/velodyne/*.bin"
    drives = "raw/*/*/velodyne_points/data/*.bin"
    scans = [*kitti_root.glob(objects), *kitti_root.glob(drives)]
    config = profile.load()
    assert len(scans) > 100
    assert [s.name for s in scans[::12] if recognise(read_scan(s)[0], config).differences] == []


def test_no_profile_is_recommended_in_place_of_itself():
    own = profile.load()
    turned = dataclasses.replace(own, sensor=dataclasses.replace(own.sensor, azimuth_step_deg=0.5))
    found = dataclasses.replace(recognise(recording("hdl-64e").sweeps[0], turned), nearest="hdl-64e")
    for name in ("hdl-64e", "hdl-64e (the default)"):
        assert "--profile" not in next(found.warnings(name, replaced=True))


def test_a_head_that_turns_twice_as_fast_is_the_same_sensor():
    sweep = recording("hdl-32e").sweeps[0]
    bearing = np.round(
        np.rad2deg(np.arctan2(sweep[:, 1], sweep[:, 0])) / profile.load("hdl-32e").sensor.azimuth_step_deg
    )
    found = recognise(sweep[bearing % 2 == 0], profile.load())
    assert found.nearest == "hdl-32e"


@pytest.mark.parametrize("name", ["hdl-32e", "vlp-16", "os1-64"])
@pytest.mark.parametrize("way_m", [0.5, 0.8, 1.2])
def test_sweeps_that_were_compensated_for_a_drive_are_of_their_sensor(name, way_m):
    """The way that a vehicle drives in a sweep moves the beams of each bearing by another angle."""
    sweep = recording(name).sweeps[0].copy()
    sweep[:, 0] -= way_m * (np.arctan2(sweep[:, 1], sweep[:, 0]) / (2 * np.pi) + 0.5)
    assert recognise(sweep, profile.load(name)).differences == ()
