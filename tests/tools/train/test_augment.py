"""Augmentation of crops."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from modt.classification.crops import Crops, gather
from modt.config import SensorConfig
from tests.classification.scenes import blobs
from tools.train.augment import augment, subsample
from tools.train.dataset import Sensors


@given(counts=st.lists(st.integers(6, 300), min_size=1, max_size=8), seed=st.integers(0, 200))
def test_augmentation_keeps_every_crop_and_enough_points(counts, seed):
    rng = np.random.default_rng(seed)
    points, proposals = blobs(counts, rng)
    crops = gather(points, proposals, np.arange(len(counts)), 1000)
    augmented, _ = augment(
        crops, Sensors.of(SensorConfig(), np.ones((len(crops), 7)), np.full(len(crops), -1.73)), rng
    )
    seen = subsample(augmented, 50, rng)
    assert len(seen) == len(counts)
    assert (seen.count >= 6).all()
    assert (seen.count <= np.minimum(counts, 50)).all()
    assert np.isfinite(seen.xyz).all()


def test_no_augmented_crop_is_finer_than_its_sensor():
    rng = np.random.default_rng(0)
    azimuth, elevation = np.meshgrid(np.arange(-3, 3, 0.1), np.arange(-4.9, 0, 0.5))  # ten beams
    a, e = np.deg2rad(azimuth.ravel()), np.deg2rad(elevation.ravel())
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
