"""Simulated sweeps as labelled scans."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import cycle

import numpy as np

from modt import profile
from modt.geometry import FieldOfView
from modt.types import Frame
from modt_simulation.simulator import Truth
from modt_simulation.synthetic_stream import CAMERA, SyntheticStream
from modt_training.scan import Scan, on_bottom

SECONDS = 4.0


def labelled_scan(
    frame: Frame, truth: Truth, name: str, world: str, *, camera: bool, sensor: str = profile.DEFAULT
) -> Scan:
    """A simulated sweep as a labelled scan, in the camera's view or over the full circle."""
    order = np.argsort(truth.instance, kind="stable")
    ends = np.searchsorted(truth.instance[order], truth.bodies, side="right")
    objects = [order[end - n : end] for end, n in zip(ends, truth.points, strict=True)]
    return Scan(
        name,
        world,
        frame.points,
        tuple(objects),
        tuple(kind.object_class for kind in truth.kinds),
        on_bottom(truth.boxes),
        FieldOfView.of_camera(CAMERA) if camera else FieldOfView(),
        np.zeros(len(frame.points), np.bool_),
        sensor,
        profile.load(sensor),
    )


def simulated_scans(
    scenes: Sequence[str],
    seeds: Sequence[int],
    times_s: Sequence[float],
    *,
    camera: bool,
    sensors: Sequence[str],
) -> Iterator[Scan]:
    """Sweeps at the given times of a short drive through each scene, for each seed, by one sensor after another."""
    in_turn = cycle(sensors)
    for seed in seeds:
        for scene in scenes:
            simulator = SyntheticStream(scene, sensor := next(in_turn), SECONDS, seed).simulator
            for time_s in times_s:
                frame, truth = simulator.sweep(round(time_s / simulator.sensor.period_s))
                name = f"{scene}-{seed}"
                yield labelled_scan(frame, truth, f"{name}/{frame.index}", name, camera=camera, sensor=sensor)
