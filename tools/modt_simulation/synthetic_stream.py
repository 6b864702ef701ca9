"""The simulator as a source of frames."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from modt.config import MountedSensor
from modt.errors import MisuseError
from modt.geometry import Camera
from modt.sources.stream import Faults, Reading, StreamInfo
from modt.types import DESKEWED, Frame, Self
from modt_simulation.covers import hidden, overhangs, platform
from modt_simulation.faults import read_faults
from modt_simulation.gait import Gait
from modt_simulation.indoors import carpark, corridor, hall, lift, lobby, warehouse
from modt_simulation.obstacles import (
    clutter,
    grass,
    heaps,
    hedges,
    hills,
    loading,
    movers,
    scooters,
    stairs,
    vines,
    wall,
)
from modt_simulation.postures import postures
from modt_simulation.sensors import sensor as sensor_model
from modt_simulation.simulator import Simulator, Truth
from modt_simulation.street import crossing, street
from modt_simulation.weather import read_weather
from modt_simulation.world import World
from modt_simulation.yard import crowd, dock, ramp, yard

T_CAMERA_SENSOR = np.array([[0.0, -1, 0, 0], [0, 0, -1, -0.08], [1, 0, 0, -0.27], [0, 0, 0, 1]])
K = np.array([[721.5, 0.0, 609.5, 0.0], [0.0, 721.5, 172.9, 0.0], [0.0, 0.0, 1.0, 0.0]])
CAMERA = Camera(K @ T_CAMERA_SENSOR, T_CAMERA_SENSOR, 1242.0, 375.0)
"""Intrinsics and mount of KITTI's left colour camera: level, 0.27 m ahead of the sensor, 0.08 m below it."""

SCENES = {
    scene.__name__: scene
    for scene in (
        *(street, crossing, yard, crowd, ramp, dock, hall, corridor, lobby, lift, warehouse, carpark),
        *(wall, grass, hedges, vines, scooters, hills, heaps, stairs, clutter),
        *(movers, loading, postures, hidden, platform, overhangs),
    )
}
"""Scene by name: the world by a random generator, a duration [s] and the height of the sensor [m]."""


class SyntheticStream:
    """A drive through a synthetic scene; the same arguments give the same bytes.

    `seed` is that of the scene, its traffic and the noise. `distort` leaves the motion during a sweep in the scans.
    `glossy` makes the paint of cars mirror most of the light away, as an HDL-64E sees it.
    The sensor is mounted as usual, or at `height_m`; `mount_deg`, its roll and pitch, adds to what is left of them
    after it was levelled. Weather, gait and faults are texts, as those of `modt simulate`. A sensor of a robot with
    several is mounted as `mounted` says, on a level robot; the first sweep is at `first_s`.

    Raises:
        MisuseError: an unknown scene, sensor, weather, gait or fault, or an invalid duration or seed.
    """

    def __init__(
        self,
        scene: str = "street",
        sensor: str = "hdl-64e",
        seconds: float = 10.0,
        seed: int = 0,
        *,
        distort: bool = False,
        glossy: bool = False,
        height_m: float | None = None,
        mount_deg: tuple[float, float] = (0.0, 0.0),
        weather: str | None = None,
        gait: str | None = None,
        faults: Sequence[str] = (),
        mounted: MountedSensor | None = None,
        first_s: float = 0.0,
        noise_seed: int | None = None,
    ) -> None:
        if scene not in SCENES:
            raise MisuseError(scene, "no such scene", f"use one of {', '.join(SCENES)}")
        if not 0 < seconds <= 3600:
            raise MisuseError(f"{seconds:g} s", "no duration of a scene", "give more than 0 and at most 3600 seconds")
        if seed < 0:
            raise MisuseError(seed, "no seed", "give an integer of at least 0")
        model = sensor_model(sensor)
        if mounted is not None:
            height_m = mounted.position_m[2]
        world = world_of(SCENES[scene], seed, seconds, height_m or model.height_m)
        roll, pitch = (np.deg2rad(mount_deg) + world.mount_rad).tolist()
        walk = Gait.of(gait, np.random.default_rng([seed, 4])) if gait else None
        if mounted is not None:
            world = replace(world, height_m=0.0, T_carrier_sensor=mounted.T_robot_sensor)
            roll = pitch = 0.0
        self.simulator = Simulator(
            replace(world, mount_rad=(roll, pitch), gait=walk),
            model,
            seed,
            distort=distort,
            glossy=glossy,
            weather=read_weather(weather) if weather else None,
            faults=read_faults(faults),
            first_s=first_s,
            noise_seed=noise_seed,
        )
        self._indices = range(max(1, round(seconds / model.period_s)))
        self.faults = Faults()
        self.reading = Reading()
        self.info = StreamInfo(
            name=f"{scene}, {sensor}, seed {seed}",
            layout="synthetic",
            sequence=0,
            n_frames=len(self._indices),
            period_s=model.period_s,
            camera=CAMERA,
            has_poses=True,
            end=self._indices.stop,
        )

    def __iter__(self) -> Iterator[Frame]:
        """The frames; each counts as a message of one sweep, which without distortion is seen in an instant."""
        self.reading = Reading(poses="the simulation")
        for frame, _ in self.sweeps():
            self.reading.messages += 1
            self.reading.sweeps += 1
            self.reading.times[DESKEWED] += frame.turn_s > 0
            yield frame

    def sweeps(self) -> Iterator[tuple[Frame, Truth]]:
        """The frames with their ground truth."""
        return (self.simulator.sweep(i) for i in self._indices)

    def between(self, first: int, last: int | None) -> Self:
        """The frames with first <= index < last; others are not rendered."""
        part = copy.copy(self)
        part.faults = Faults()
        stop = self._indices.stop if last is None else min(last, self._indices.stop)
        part._indices = range(max(first, self._indices.start), stop)
        part.info = replace(self.info, n_frames=len(part._indices), end=part._indices.stop)
        return part


@lru_cache(maxsize=8)
def world_of(
    scene: Callable[[np.random.Generator, float, float], World], seed: int, seconds: float, height_m: float
) -> World:
    """World of a scene, which never changes: to make a street takes as long as ten sweeps of it."""
    return scene(np.random.default_rng([seed, 0]), seconds, height_m)


def embedded_street() -> SyntheticStream:
    """The stream of `modt replay` without a path: ten seconds of the street, seen by an HDL-64E."""
    return SyntheticStream("street", "hdl-64e", 10.0, seed=0)
