"""Roll and pitch of a sensor by the floor of a sweep."""

import logging

import numpy as np
import pytest

from modt import profile
from modt.app.chosen_profile import choose
from modt.sensor_fit.recognition import recognise
from modt.sensor_fit.tilt import MIN_TILT_DEG, find_floor
from modt_profiling.sensor_fit.findings import Recording
from modt_profiling.sensor_fit.fit import fit
from modt_simulation.synthetic_stream import SyntheticStream
from tests.sensor_fit.recordings import recording

MOUNTS = [(0.0, 0.0), (0.0, 15.0), (-15.0, 0.0), (8.0, -10.0), (180.0, 0.0), (170.0, 10.0)]
HEIGHTS_M = {"vlp-16": 0.8, "os1-64": 0.5, "mid-360": 0.3}


def stream(scene, sensor, mount_deg):
    return SyntheticStream(scene, sensor, 2.0, 3, height_m=HEIGHTS_M[sensor], mount_deg=mount_deg)


@pytest.mark.parametrize("mount_deg", MOUNTS)
@pytest.mark.parametrize(("scene", "sensor"), [("yard", "vlp-16"), ("corridor", "os1-64"), ("hall", "mid-360")])
def test_the_mount_is_measured_by_the_floor_to_half_a_degree(scene, sensor, mount_deg):
    frame = next(iter(stream(scene, sensor, mount_deg)))
    floor = find_floor(frame.points, HEIGHTS_M[sensor])
    off_deg = np.rad2deg(np.arccos(np.clip(floor.up @ frame.T_world_sensor[2, :3], -1, 1)))
    assert off_deg < 0.5
    assert floor.depth_m == pytest.approx(HEIGHTS_M[sensor], abs=0.05)


@pytest.mark.parametrize("sensor", ["vlp-16", "os1-64", "hdl-64e"])
@pytest.mark.parametrize("seed", [900, 901])
def test_a_level_sensor_in_a_street_stays_as_it_is(sensor, seed):
    frame = next(iter(SyntheticStream("street", sensor, 0.1, seed)))
    assert find_floor(frame.points).tilt_deg() < MIN_TILT_DEG
    assert recognise(frame.points, profile.load(sensor)).tilt_deg is None


@pytest.mark.kitti
def test_the_sensor_of_kitti_is_level(kitti_root):
    from modt.sources.scan_file import read_scan

    scans = sorted(kitti_root.glob("raw/*/*/velodyne_points/data/*.bin"))[::10]
    tilts_deg = np.array([find_floor(read_scan(scan)[0]).tilt_deg() for scan in scans])
    assert np.median(tilts_deg) < 1.2
    assert (tilts_deg > MIN_TILT_DEG).mean() < 0.05


@pytest.mark.parametrize(("mount_deg", "named"), [((0.0, 15.0), "tilted"), ((180.0, 0.0), "upside down")])
def test_a_tilt_that_a_profile_leaves_open_is_named_once_and_applied(mount_deg, named, caplog):
    tilted = stream("yard", "vlp-16", mount_deg)
    with caplog.at_level(logging.WARNING):
        chosen = choose(profile.resolve("vlp-16"), next(iter(tilted)), tilted.info)
    assert [named in record.message for record in caplog.records] == [True]
    assert chosen.recognition.differences == ()  # the height above all
    sensor = chosen.config.sensor
    # beside the mount the sensor was levelled by eye, to half a degree or so
    assert abs((sensor.roll_deg - mount_deg[0] + 180) % 360 - 180) < 1.5
    assert sensor.pitch_deg == pytest.approx(mount_deg[1], abs=1.5)


def test_a_mount_that_a_profile_states_is_kept_and_another_one_named():
    frame = next(iter(stream("yard", "vlp-16", (0.0, 15.0))))
    base = profile.load("vlp-16")
    stated = profile.parse("sensor: {roll_deg: 0, pitch_deg: 15.5}\nextends: vlp-16", "test")
    found = recognise(frame.points, stated)
    assert found.tilt_deg is None
    assert found.differences == ()
    assert found.mounted(stated) == stated
    assert recognise(frame.points, base).mounted(base).sensor.pitch_deg == pytest.approx(15.5, abs=0.7)
    found = recognise(frame.points, profile.parse("sensor: {roll_deg: 0, pitch_deg: 0}\nextends: vlp-16", "test"))
    assert any("pitched by 15" in difference for difference in found.differences)


@pytest.mark.slow
def test_a_fitted_profile_has_the_mount_and_the_height_of_a_level_sensor():
    tilted = stream("yard", "vlp-16", (10.0, 12.0))
    frames = [tilted.simulator.sweep(5 * k)[0] for k in range(4)]
    config, _ = fit(Recording([frame.points for frame in frames], [frame.stamp_s for frame in frames]))
    level, _ = fit(recording("vlp-16", "yard"))
    assert level.sensor.roll_deg == level.sensor.pitch_deg == 0.0
    assert config.sensor.roll_deg == pytest.approx(10.0, abs=1.0)
    assert config.sensor.pitch_deg == pytest.approx(12.5, abs=1.0)
    assert config.sensor.height_m == pytest.approx(0.8, abs=0.05)


def surface(height_m, ahead_m, behind_m):
    """(n, 4) points of a strip along x; its height above the sensor is a function of x [m]."""
    rng = np.random.default_rng(5)
    x = rng.uniform(-behind_m, ahead_m, 6000)
    y = rng.uniform(-3.0, 3.0, len(x))
    z = height_m(x) + rng.normal(0.0, 0.01, len(x))
    return np.stack([x, y, z, np.zeros(len(x))], axis=1).astype(np.float32)


def test_level_beams_in_tall_grass_are_no_floor():
    assert find_floor(surface(lambda x: 0.02 + 0.0 * x, 10.0, 10.0)) is None


def test_the_side_of_a_hill_behind_is_no_tilt_of_the_mount():
    def height_m(x):
        return -0.8 + np.sin(2 * np.pi * (x - 2.0) / 20.0) + np.sin(0.2 * np.pi)

    hill = surface(height_m, 3.0, 12.0)
    assert find_floor(hill).tilt_deg() > MIN_TILT_DEG
    assert find_floor(hill, 0.8) is None
