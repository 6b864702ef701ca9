"""Recordings of simulated sensors."""

from __future__ import annotations

from functools import cache

import numpy as np

from modt.sensor_fit.reflectance import SCALES
from modt_profiling.sensor_fit.findings import Recording
from modt_simulation.synthetic_stream import SyntheticStream


@cache
def recording(sensor, scene="street", sweeps=6, seed=3):
    """Sweeps half a second apart."""
    simulator = SyntheticStream(scene, sensor, 4.0, seed).simulator
    frames = [simulator.sweep(5 * k)[0] for k in range(sweeps)]
    return Recording([frame.points for frame in frames], [frame.stamp_s for frame in frames])


def with_scale(recorded, name):
    """The same with reflectances on a scale that is known."""
    rng = np.random.default_rng(0)
    values = np.array([0.0, *SCALES[name].deciles, 0.5], np.float32)
    sweeps = [np.column_stack([sweep[:, :3], rng.choice(values, len(sweep))]) for sweep in recorded.sweeps]
    return Recording(sweeps, recorded.stamps_s)


def with_mast(recorded, azimuth_deg, range_m):
    """The same with a mast of the robot 8 degrees wide."""
    azimuth, rise_m = np.meshgrid(np.deg2rad(np.linspace(-4, 4, 40) + azimuth_deg), np.linspace(-0.4, 0.4, 20))
    mast = np.stack([range_m * np.cos(azimuth), range_m * np.sin(azimuth), rise_m, 0 * rise_m + 0.5], axis=-1)
    points = mast.reshape(-1, 4).astype(np.float32)
    return Recording([np.concatenate([sweep, points]) for sweep in recorded.sweeps], recorded.stamps_s)
