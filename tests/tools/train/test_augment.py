"""Augmentation of crops, and crops of people and things near a low sensor."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.classification.crops import Crops, gather
from modt.config import SensorConfig
from modt.types import Cut
from modt_training.augment import MAX_NOISE_M, augment, subsample, worn
from modt_training.dataset import Sensors
from tests.classification.scenes import blobs
from tests.tools.train.datasets import data_of
from tools.train.near_batches import MIN_CUT_POINTS, NearSource, cut_near
from tools.train.near_scans import HEIGHT_M, near_scans


@given(counts=st.lists(st.integers(6, 300), min_size=1, max_size=8), seed=st.integers(0, 200))
def test_augmentation_keeps_every_crop_and_enough_points(counts, seed):
    rng = np.random.default_rng(seed)
    _, proposals = blobs(counts, rng)
    crops = gather(proposals, np.arange(len(counts)), 1000)
    augmented, _ = augment(
        crops, Sensors.of(SensorConfig(), np.ones((len(crops), 7)), np.full(len(crops), -1.73)), rng
    )
    seen = subsample(augmented, 50, rng)
    assert len(seen) == len(counts)
    assert (seen.count >= 6).all()
    assert (seen.count <= np.minimum(counts, 50)).all()
    assert np.isfinite(seen.xyz).all()


def test_no_augmented_crop_is_finer_than_its_sensor(rng):
    azimuth, elevation = np.meshgrid(np.arange(-3, 3, 0.1), np.arange(-4.9, 0, 0.5))  # ten beams
    a = np.deg2rad(azimuth.ravel())
    e = np.deg2rad(elevation.ravel())
    wall = np.c_[15 * np.cos(a), 15 * np.sin(a), 15 * np.tan(e)].astype(np.float32)
    n = 200
    crops = Crops(np.tile(wall, (n, 1)), np.arange(n + 1) * len(wall))
    config = SensorConfig(elevation_step_deg=0.5, azimuth_step_deg=0.2)
    augmented, sensors = augment(crops, Sensors.of(config, np.ones((n, 7)), np.full(n, -1.73)), rng)
    step = np.round(sensors.elevation_deg / config.elevation_step_deg, 3)
    assert sorted(set(step.tolist())) == [1, 2, 4]
    mean = [augmented.count[step == k].mean() for k in (1, 2, 4)]
    assert mean[0] < 0.5 * len(wall)  # no more than one return for each 0.2 degrees
    np.testing.assert_allclose(mean[0] / mean[1:], [2, 4], rtol=0.25)


def boards(n: int, height_m: float = 1.8) -> tuple[Crops, Sensors]:
    """Upright boards 0.5 m wide, 10 m away from a sensor 1.73 m above the ground."""
    y, z = np.meshgrid(np.linspace(-0.25, 0.25, 8), np.linspace(-1.4, height_m - 1.73, 60))
    one = np.stack([np.full(y.size, 10.0), y.ravel(), z.ravel()], axis=1)
    crops = Crops(np.tile(one, (n, 1)).astype(np.float32), np.arange(n + 1) * len(one))
    ground = np.full(n, -1.73)
    step = np.full(n, 0.4)
    return crops, Sensors(ground, step, step)


def test_a_worn_sensor_moves_points_along_their_rays_and_loses_whole_beams():
    rng = np.random.default_rng(3)
    crops, sensors = boards(300)
    found = worn(crops, sensors, rng)
    range_m = np.linalg.norm(found.xyz, axis=1)
    depth_m = found.xyz[:, 0] / range_m
    assert (np.abs(range_m - 10.0 / depth_m) < 6 * MAX_NOISE_M).all()
    lost = crops.count - found.count
    assert (lost >= 0).all()
    assert 0.2 < (lost == 0).mean() < 0.5
    assert (found.count >= 6).all()


@given(st.integers(0, 2**32 - 1))
def test_crops_cut_near_lie_between_the_beams_and_keep_their_places_above_the_ground(seed):
    crops, sensors = boards(20)
    cut, near, rows, flags = cut_near(crops, sensors, np.random.default_rng(seed))
    assert len(cut) == len(rows) == len(flags)
    assert (cut.count >= MIN_CUT_POINTS).all()
    assert (flags > 0).all()
    mount_m = np.repeat(-near.ground_z_m, cut.count)
    assert ((near.ground_z_m <= -HEIGHT_M[0]) & (near.ground_z_m >= -HEIGHT_M[1])).all()
    above_m = cut.xyz[:, 2] + mount_m
    assert (above_m > 0.32).all()
    assert (above_m < 1.81).all()
    top_m = np.maximum.reduceat(above_m, cut.offsets[:-1])
    assert ((flags & Cut.TOP) > 0)[top_m < 1.79].all()


def test_each_scan_is_seen_from_a_low_mount_of_its_own():
    scans = list(near_scans(range(4), ["vlp-16", "mid-360"]))
    heights = [scan.profile.sensor.height_m for scan in scans]
    assert len(set(heights)) == 4
    assert all(h is not None and HEIGHT_M[0] <= h <= HEIGHT_M[1] for h in heights)
    for scan, height_m in zip(scans, heights, strict=True):
        below = scan.points[np.hypot(*scan.points[:, :2].T) < 3.0, 2].min()
        assert height_m is not None
        assert below == pytest.approx(-height_m, abs=0.15) or scan.sensor == "mid-360"


def test_a_batch_holds_simulated_crops_and_crops_of_the_streets_cut_near():
    crops, sensors = boards(8)
    label = np.arange(8) % 4
    data = data_of(crops, label, sensors=sensors)
    batch = NearSource(data, data).draw(np.random.default_rng(1))
    from_streets = batch.sensors.ground_z_m > -1.5
    assert 20 < from_streets.sum() < len(batch.crops)
    assert ((batch.cut[from_streets] & ~Cut.SIDE) > 0).all()
    assert not (batch.cut[~from_streets] & ~Cut.SIDE).any()  # of an HDL-64E it is not known where the beams end
