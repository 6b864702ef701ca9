"""Sweeps of a sensor in a world, with the ground truth of every point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.geometry import inverse, transform, transform_boxes
from modt.types import NONE, Float32, Float64, Frame, Int
from modt_desk.simulation.kinds import Kind
from modt_desk.simulation.materials import BODY_SIGMA, SEMANTIC
from modt_desk.simulation.raycast import NO_SOLID, RayCaster
from modt_desk.simulation.returns import Receiver
from modt_desk.simulation.sensors import SensorModel
from modt_desk.simulation.world import MOVING_MPS, World

N_SLICES = 64
"""Sectors of a sweep within which nothing moves."""


def slice_delay_s(part: int, period_s: float) -> float:
    """Time after the stamp at which a sector is measured [s]; sectors go counter-clockwise from straight ahead."""
    share = (part + 0.5) / N_SLICES
    return (float(share > 0.5) - share) * period_s


@dataclass(frozen=True, slots=True)
class Truth:
    """Ground truth of a sweep."""

    instance: Int  # (N,) body of each point, NONE for the ground
    semantic: Int  # (N,) SemanticKITTI label of each point
    object_class: Int  # (N,) class of each point's body
    bodies: Int  # (b,) indices of all bodies of annotated kinds, visible or not: their identities
    kinds: tuple[Kind, ...]  # kind of each
    boxes: Float64  # (b, 7) box of each, sensor frame
    points: Int  # (b,) number of points of each in this sweep
    speed_mps: Float64  # (b,) speed of each


class Simulator:
    """Renders sweeps, in any order, each reproducibly by the seed of the noise.

    `distort` leaves the motion of the carrier and the bodies during a sweep in the scans of a rotating sensor; else
    they are as after deskewing.
    """

    def __init__(self, world: World, sensor: SensorModel, seed: int, *, distort: bool = False) -> None:
        self.world, self.sensor, self.seed = world, sensor, seed
        self.distort = distort and sensor.rotating
        self.caster = RayCaster(sensor)
        self.receiver = Receiver(sensor, np.random.default_rng([seed, 1]))
        normal = np.random.default_rng([seed, 3]).standard_normal((len(world.bodies), len(BODY_SIGMA)), np.float32)
        self._intensity_offset = normal * BODY_SIGMA
        self._object_class = np.array([b.kind.object_class for b in world.bodies] + [0], np.int64)
        self._annotated = np.array([i for i, b in enumerate(world.bodies) if b.kind.name], np.int64)
        self._kinds = tuple(world.bodies[i].kind for i in self._annotated.tolist())
        self._labels = np.array([(b.kind.semantic, b.kind.moving) for b in world.bodies], np.int64).reshape(-1, 2)

    def sweep(self, index: int) -> tuple[Frame, Truth]:
        """Frame number index and its ground truth."""
        rng = np.random.default_rng([self.seed, 2, index])
        time_s = index * self.sensor.period_s
        T_world_sensor = self.world.ego_pose(time_s)
        solids = self.world.solids(time_s, T_world_sensor, self.sensor.max_range_m)
        solids = solids.widened_by_beam(self.sensor.beam_radius_m, self.sensor.divergence_rad)
        ground, ground_material = self.world.terrain.cast(self.caster, T_world_sensor)
        image = self.caster.cast(solids, ground, rng.standard_exponential(self.sensor.shape, np.float32))
        of_solid = np.append(solids.material, 0).astype(np.uint8)
        material = np.where(image.solid != NO_SOLID, of_solid[image.solid], ground_material)
        offset = np.append(self._intensity_offset[solids.body, solids.material], np.float32(0))
        distance, intensity, ray = self.receiver.receive(image.distance, material, image.solid, offset, rng)
        row, column = np.divmod(ray, self.sensor.shape[1])
        fired = self.sensor.fires(row, column, index)
        ray, row, column, intensity = ray[fired], row[fired], column[fired], intensity[fired]
        s = distance.ravel()[ray]
        jitter = rng.standard_normal(len(s), np.float32) * np.float32(self.sensor.azimuth_sigma_rad)
        rise = rng.standard_normal(len(s), np.float32) * np.float32(self.sensor.elevation_sigma_rad)
        cos, sin = self.caster.cos[column], self.caster.sin[column]
        points = np.empty((len(s), 4), np.float32)
        points[:, 0] = s * (cos - jitter * sin)
        points[:, 1] = s * (sin + jitter * cos)
        points[:, 2] = s * (self.caster.tangent[row, 0] + rise) + self.caster.origin[row, 0]
        points[:, 3] = intensity
        instance = np.append(solids.body, NONE)[image.solid.ravel()[ray]]
        if self.distort:
            self._distort(points, column, instance, time_s)
        turn_s = self.sensor.period_s if self.distort else 0.0
        frame = Frame(index, time_s, points, T_world_sensor, turn_s=turn_s)
        return frame, self._truth(time_s, T_world_sensor, instance, material.ravel()[ray])

    def _distort(self, points: Float32, column: Int, instance: Int, time_s: float) -> None:
        """Move the points of each sector to the sensor frame at the time of its measurement.

        The sensor rotates clockwise, as Velodyne's and Ouster's do, and points straight ahead at the stamp.
        """
        T_world_start = self.world.ego_pose(time_s)
        pose = np.vstack([self.world.poses(time_s), np.zeros(5)])
        speed, heading = pose[instance, 4], pose[instance, 3]
        velocity = speed[:, None] * np.stack([np.cos(heading), np.sin(heading), np.zeros_like(heading)], axis=1)
        part = column * N_SLICES // self.sensor.shape[1]
        for k in range(N_SLICES):
            rows = np.flatnonzero(part == k)
            delay_s = slice_delay_s(k, self.sensor.period_s)
            world = transform(T_world_start, points[rows, :3].astype(np.float64)) + delay_s * velocity[rows]
            points[rows, :3] = transform(inverse(self._ego_pose(time_s, delay_s)), world)

    def _ego_pose(self, time_s: float, delay_s: float) -> Float64:
        """(4, 4) T_world_sensor after a delay, extrapolated before the start of the drive."""
        if time_s + delay_s >= 0.0:
            return self.world.ego_pose(time_s + delay_s)
        T = self.world.ego_pose(time_s)
        return T @ inverse(self.world.ego_pose(time_s - delay_s)) @ T

    def _truth(self, time_s: float, T_world_sensor: Float64, instance: Int, material: Int) -> Truth:
        world, shown = self.world, self._annotated
        speed = world.poses(time_s)[:, 4]
        label = np.append(np.where(speed > MOVING_MPS, self._labels[:, 1], self._labels[:, 0]), 0)[instance]
        return Truth(
            instance=instance,
            semantic=np.where(label > 0, label, SEMANTIC[material]).astype(np.int64),
            object_class=self._object_class[instance],
            bodies=shown,
            kinds=self._kinds,
            boxes=transform_boxes(inverse(T_world_sensor), world.boxes(time_s)[shown]),
            points=np.bincount(instance + 1, minlength=len(world.bodies) + 1)[1:][shown],
            speed_mps=speed[shown],
        )
