"""Simulated sweeps by sensors with dead beams, noisy ranges and tilted mounts.

A network that has learnt from sound sensors takes a car of which a ring is missing for background, and a person of
scattered points for a cyclist.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import cycle

import numpy as np
from numpy.random import Generator

from modt.geometry import rotation_zyx, yaw_of
from modt.types import Frame
from modt_simulation.sensors import SENSORS, SensorModel
from modt_simulation.synthetic_stream import SyntheticStream
from modt_training.scan import Scan
from modt_training.simulated import SECONDS, labelled_scan

SCENES = ("street", "crossing", "yard")
SWEEPS = 3
"""Number of sweeps of a world, each by a sensor of its own."""
NOISE_SHARE = 0.5
"""Share of the sweeps with noisy ranges."""
NOISE_M = (0.02, 0.12)
"""Least and greatest standard deviation of the noise of a range."""
BEAMS_SHARE = 0.6
"""Share of the sweeps with dead beams."""
MAX_DEAD = 3
"""Greatest number of single dead beams."""
THINNED_SHARE = 0.25
"""Share of such sweeps of which every second beam is dead."""
HORIZON_DEG = 6.0
"""Greatest elevation, up or down, of the beams that meet objects; half of the single dead beams are among them."""
TILT_SHARE = 0.3
"""Share of the sweeps with a tilted mount."""
TILT_DEG = (12.0, 15.0)
"""Greatest roll and pitch of the mount."""
SPARSE_SENSORS = ("vlp-16", "vlp-16", "vlp-16", "os1-32", "hdl-32e", "xt-32", "mid-360")
"""Sensors besides all others, since few rings suffer most."""


def dead_beams(rng: Generator, sensor: SensorModel) -> list[int]:
    """Rows of the dead beams of a sensor, none or some."""
    beams = len(sensor.elevation_rad)
    if rng.random() > BEAMS_SHARE or not sensor.rotating:
        return []
    if rng.random() < THINNED_SHARE:
        return list(range(int(rng.integers(2)), beams, 2))
    near_horizon = np.flatnonzero(np.abs(np.rad2deg(sensor.elevation_rad)) < HORIZON_DEG)
    rows = near_horizon if rng.random() < 0.5 else np.arange(beams)
    # A dense sensor loses a share of its beams that shows as much as one of a sparse one.
    most = MAX_DEAD * max(1, beams // 32)
    return rng.choice(rows, min(int(rng.integers(1, most + 1)), len(rows)), replace=False).tolist()


def worn_scan(scene: str, name: str, seed: int, index: int, rng: Generator) -> Scan:
    """A sweep of a scene by a worn sensor."""
    faults = [f"beam:{row}" for row in dead_beams(rng, SENSORS[name])]
    if rng.random() < NOISE_SHARE:
        faults.append(f"noise:{rng.uniform(*NOISE_M):.3f}")
    tilt = np.multiply(TILT_DEG, rng.uniform(-1.0, 1.0, 2)) if rng.random() < TILT_SHARE else np.zeros(2)
    stream = SyntheticStream(scene, name, SECONDS, seed, mount_deg=(tilt[0], tilt[1]), faults=faults)
    frame, truth = stream.simulator.sweep(index)
    world = f"{scene}-{seed}"
    return labelled_scan(levelled(frame), truth, f"{world}/{index}", world, camera=False, sensor=name)


def levelled(frame: Frame) -> Frame:
    """The frame with its points turned level by the attitude of its pose."""
    assert frame.T_world_sensor is not None
    R_level_sensor = rotation_zyx(0.0, 0.0, -yaw_of(frame.T_world_sensor)) @ frame.T_world_sensor[:3, :3]
    points = frame.points.copy()
    points[:, :3] = points[:, :3] @ R_level_sensor.T.astype(np.float32)
    return replace(frame, points=points)


def worn_scans(seeds: Sequence[int]) -> Iterator[Scan]:
    """Sweeps of a world for each seed, by one sensor after another, each worn in its own way."""
    scene_of = cycle(SCENES)
    sensor_of = cycle((*SENSORS, *SPARSE_SENSORS))
    for seed in seeds:
        rng = np.random.default_rng([seed, 8])
        scene = next(scene_of)
        for k in range(SWEEPS):
            name = next(sensor_of)
            period_s = SENSORS[name].period_s
            yield worn_scan(scene, name, seed, round(k * SECONDS / SWEEPS / period_s), rng)
