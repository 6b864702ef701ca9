"""Sweeps of a world by a sensor, with the truth about every point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.geometry import inverse, transform, transform_boxes
from modt.simulation.kinds import Kind
from modt.simulation.materials import SEMANTIC, SHADE
from modt.simulation.raycast import NOTHING, RayCaster
from modt.simulation.returns import Receiver
from modt.simulation.sensors import SensorModel
from modt.simulation.world import MOVING_MPS, World
from modt.types import NONE, Float32, Float64, Frame, Int

SLICES = 64
"""Slices of a turn within which nothing moves."""


def late_of(part: int, period_s: float) -> float:
    """How long after the stamp the head looks at a slice [s]; slices go counter-clockwise from straight ahead."""
    round_ = (part + 0.5) / SLICES
    return (float(round_ > 0.5) - round_) * period_s


@dataclass(frozen=True, slots=True)
class Truth:
    """What a sweep really shows.

    Attributes:
        instance: (N,) body of each point, NONE for the ground.
        semantic: (N,) SemanticKITTI class of each point.
        object_class: (N,) what a classifier should say of each point's body.
        bodies: (b,) bodies of annotated kinds, wherever they are; their numbers are their identities.
        kinds: kind of each of them.
        boxes: (b, 7) their boxes, sensor frame.
        points: (b,) points that each of them has in this sweep.
        speed_mps: (b,) their speeds.
    """

    instance: Int
    semantic: Int
    object_class: Int
    bodies: Int
    kinds: tuple[Kind, ...]
    boxes: Float64
    points: Int
    speed_mps: Float64


class Simulator:
    """Renders sweeps, each by itself and the same whenever asked.

    Args:
        world: what there is to see.
        sensor: who sees it.
        seed: of the noise.
        distort: leave in the scans what the head's turning does while its carrier and the bodies move; without it
            they are as after its removal.
    """

    def __init__(self, world: World, sensor: SensorModel, seed: int, *, distort: bool = False) -> None:
        self.world, self.sensor, self.seed, self.distort = world, sensor, seed, distort
        self.caster = RayCaster(sensor)
        self.receiver = Receiver(sensor, np.random.default_rng([seed, 1]))
        chance = np.random.default_rng([seed, 3]).standard_normal((len(world.bodies), len(SHADE)), np.float32)
        self._shade = chance * SHADE
        self._object_class = np.array([b.kind.object_class for b in world.bodies] + [0], np.int64)
        self._annotated = np.array([i for i, b in enumerate(world.bodies) if b.kind.name], np.int64)
        self._kinds = tuple(world.bodies[i].kind for i in self._annotated.tolist())
        self._label = np.array([b.kind.semantic for b in world.bodies], np.int64)
        self._moving_label = np.array([b.kind.moving for b in world.bodies], np.int64)

    def sweep(self, index: int) -> tuple[Frame, Truth]:
        """Frame number index and the truth about it."""
        rng = np.random.default_rng([self.seed, 2, index])
        time_s = index * self.sensor.period_s
        T_world_sensor = self.world.ego_pose(time_s)
        pieces = self.world.pieces(time_s, T_world_sensor, self.sensor.max_range_m)
        pieces = pieces.as_met(self.sensor.spot_m, self.sensor.divergence_rad)
        ground, surface = self.world.terrain.cast(self.caster, T_world_sensor)
        image = self.caster.cast(pieces, ground, rng.standard_exponential(self.sensor.shape, np.float32))
        of_piece = np.append(pieces.material, 0).astype(np.uint8)
        material = np.where(image.piece != NOTHING, of_piece[image.piece], surface)
        shade = np.append(self._shade[pieces.body, pieces.material], np.float32(0))
        distance, brightness, ray = self.receiver.receive(image.distance, material, image.piece, shade, rng)
        row, column = np.divmod(ray, self.sensor.shape[1])
        s = distance.ravel()[ray]
        jitter = rng.standard_normal(len(s), np.float32) * np.float32(self.sensor.azimuth_sigma_rad)
        cos, sin = self.caster.cos[column], self.caster.sin[column]
        points = np.empty((len(s), 4), np.float32)
        points[:, 0] = s * (cos - jitter * sin)
        points[:, 1] = s * (sin + jitter * cos)
        points[:, 2] = s * self.caster.tangent[row, 0] + self.caster.origin[row, 0]
        points[:, 3] = brightness
        instance = np.append(pieces.body, NONE)[image.piece.ravel()[ray]]
        distorted = self.distort and self.sensor.turns
        if distorted:
            self._distort(points, column, instance, time_s)
        turn_s = self.sensor.period_s if distorted else 0.0
        frame = Frame(index, time_s, points, T_world_sensor, turn_s=turn_s)
        return frame, self._truth(time_s, T_world_sensor, instance, material.ravel()[ray])

    def _distort(self, points: Float32, column: Int, instance: Int, time_s: float) -> None:
        """Move each point to where the head saw it from when it turned that way, SLICES to a turn.

        It turns clockwise, as Velodyne's and Ouster's do, and looks ahead at the stamp.
        """
        world, last = self.world, self.sensor.shape[1]
        T_world_start = world.ego_pose(time_s)
        pose = np.vstack([world.poses(time_s), np.zeros(5)])
        speed, heading = pose[instance, 4], pose[instance, 3]
        velocity = speed[:, None] * np.stack([np.cos(heading), np.sin(heading), np.zeros_like(heading)], axis=1)
        part = column * SLICES // last
        for k in range(SLICES):
            rows = np.flatnonzero(part == k)
            late_s = late_of(k, self.sensor.period_s)
            seen = transform(T_world_start, points[rows, :3].astype(np.float64)) + late_s * velocity[rows]
            points[rows, :3] = transform(inverse(self._ego_pose(time_s, late_s)), seen)

    def _ego_pose(self, time_s: float, late_s: float) -> Float64:
        """(4, 4) pose so long after a time; before the drive begins the sensor came as it goes on."""
        if time_s + late_s >= 0.0:
            return self.world.ego_pose(time_s + late_s)
        T = self.world.ego_pose(time_s)
        return T @ inverse(self.world.ego_pose(time_s - late_s)) @ T

    def _truth(self, time_s: float, T_world_sensor: Float64, instance: Int, material: Int) -> Truth:
        world = self.world
        speed = world.poses(time_s)[:, 4]
        label = np.append(np.where(speed > MOVING_MPS, self._moving_label, self._label), 0)
        own = label[instance]
        boxes = world.boxes(time_s)[self._annotated]
        return Truth(
            instance=instance,
            semantic=np.where(own > 0, own, SEMANTIC[material]).astype(np.int64),
            object_class=self._object_class[instance],
            bodies=self._annotated,
            kinds=self._kinds,
            boxes=transform_boxes(inverse(T_world_sensor), boxes),
            points=np.bincount(instance + 1, minlength=len(world.bodies) + 1)[1:][self._annotated],
            speed_mps=speed[self._annotated],
        )
