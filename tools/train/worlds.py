"""Kinds of simulated worlds, each seen in one sweep by a sensor at a height of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import cycle

import numpy as np
from numpy.random import Generator

from modt.config import ProfileConfig
from modt_simulation.sensors import SENSORS
from modt_simulation.simulator import Simulator
from modt_simulation.world import World
from modt_training.scan import Scan
from modt_training.simulated import labelled_scan


@dataclass(frozen=True, kw_only=True)
class Worlds:
    """A kind of worlds.

    Attributes:
        name: beginning of the names of their scans.
        stream: number that sets their random choices apart from those of the other kinds.
        scene: a world by a random generator and the height of the sensor [m].
        height_m: least and greatest height of a mount that is not the usual one of its sensor.
        usual_height_share: share of the sweeps from the usual height of the sensor.
        sweeps: a scan is one of so many first sweeps of its world.
        profile: profile of a sensor at a height [m].
    """

    name: str
    stream: int
    scene: Callable[[Generator, float], World]
    height_m: tuple[float, float]
    usual_height_share: float
    sweeps: int
    profile: Callable[[str, float], ProfileConfig]

    def scans(self, seeds: Sequence[int], sensors: Sequence[str] = tuple(SENSORS)) -> Iterator[Scan]:
        """A sweep of a world for each seed, by one sensor after another."""
        for seed, name in zip(seeds, cycle(sensors), strict=False):
            rng = np.random.default_rng([seed, self.stream])
            usual = rng.random() < self.usual_height_share
            height_m = SENSORS[name].height_m if usual else float(np.exp(rng.uniform(*np.log(self.height_m))))
            simulator = Simulator(self.scene(rng, height_m), SENSORS[name], seed)
            frame, truth = simulator.sweep(int(rng.integers(0, self.sweeps)))
            world = f"{self.name}-{seed}"
            scan = labelled_scan(frame, truth, world, world, camera=False, sensor=name)
            yield replace(scan, profile=self.profile(name, height_m))
