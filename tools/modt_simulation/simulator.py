"""Sweeps of a sensor in a world: noise, losses, mixed pixels, intensity, and the ground truth of every point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from modt.geometry import inverse, transform, transform_boxes
from modt.types import NONE, Bool, Float32, Float64, Frame, Int
from modt_simulation.kinds import Kind
from modt_simulation.materials import (
    BODY_SIGMA,
    DROPOUT,
    GRAZING_LOSS,
    INTENSITY,
    POINT_SIGMA,
    REFLECTIVITY,
    SEMANTIC,
)
from modt_simulation.raycast import NO_SOLID, Int32, RayCaster
from modt_simulation.sensors import SensorModel
from modt_simulation.terrain import UInt8
from modt_simulation.world import MOVING_MPS, World

GLOSSY = np.float32(0.25)
"""Grazing loss above which the slope between beams counts as well, as on roofs and bonnets."""


class Receiver:
    """The receiver of a sensor; rng draws the constant errors of its beams."""

    def __init__(self, sensor: SensorModel, rng: Generator) -> None:
        self.sensor = sensor
        self.bias = rng.normal(0.0, sensor.beam_sigma_m, (sensor.shape[0], 1)).astype(np.float32)
        self.gain = rng.normal(1.0, 0.08, (sensor.shape[0], 1)).astype(np.float32)
        self.secant: Float32 = np.sqrt(1 + np.square(sensor.tangent[:, None]))

    def receive(
        self, distance: Float32, material: UInt8, solid: Int32, offset: Float32, rng: Generator
    ) -> tuple[Float32, Float32, Int, Int]:
        """Noisy returns of a sweep.

        Distance, material and solid are (B, A): the true horizontal distance [m] is infinite without a surface, the
        solid negative for the ground. `offset` (P + 1,) is the intensity of each surface relative to its material;
        the last is the ground's.

        Returns:
            (B, A) measured horizontal distances [m], and (n,) intensities [0, 1], rows and columns of the n returns.
        """
        sensor = self.sensor
        chance = rng.random(distance.shape, dtype=np.float32)
        noise = rng.standard_normal(distance.shape, dtype=np.float32)
        hit = np.isfinite(distance)
        near = np.where(hit, distance, np.float32(1e4))
        cosine = self._cos_incidence(near, solid)
        grain = noise[:, ::-1]  # a second sequence of random numbers, for the surface
        reflectivity = REFLECTIVITY.take(material) * self.gain * (1 + np.float32(0.15) * grain)
        slant = near * self.secant
        signal = reflectivity * cosine * np.float32(10 * sensor.detect_m**2) / (slant * slant)
        lost = DROPOUT.take(material) + np.float32(sensor.dropout)
        detected = hit & (chance > lost + (1 - lost) / (1 + signal * signal))
        detected &= (slant > sensor.min_range_m) & (slant < sensor.max_range_m)
        error = (self.bias + np.float32(sensor.range_sigma_m) * noise).astype(np.float32)
        measured: Float32 = near + error / self.secant
        self._mix_edges(measured, near, detected, chance)
        intensity: Float32 = INTENSITY.take(material) * self.gain
        intensity += offset.take(solid, mode="wrap")
        loss = GRAZING_LOSS.take(material)
        intensity -= loss * (1 - self._cos_glossy(near, solid, cosine, loss > GLOSSY))
        intensity += POINT_SIGMA.take(material) * grain
        row, column = np.nonzero(detected)
        return measured, sensor.response.report(intensity[detected], slant[detected]), row, column

    def _cos_incidence(self, near: Float32, solid: Int32) -> Float32:
        """(B, A) cosine of the angle of incidence, by the slope of the range image along a beam."""
        step = np.float32(self.sensor.azimuth_rad[1] - self.sensor.azimuth_rad[0])
        slope = np.zeros_like(near)
        np.subtract(near[:, 1:], near[:, :-1], out=slope[:, 1:])
        same = np.zeros(near.shape, np.bool_)
        np.equal(solid[:, 1:], solid[:, :-1], out=same[:, 1:])
        slope /= near * step
        level = 1 / np.sqrt(1 + slope * slope)
        ground = np.abs(self.sensor.tangent[:, None]) / self.secant + np.float32(0.05)
        return np.where(solid < 0, ground, np.where(same, level, np.float32(0.7))).astype(np.float32)

    def _cos_glossy(self, near: Float32, solid: Int32, cosine: Float32, glossy: Bool) -> Float32:
        """(B, A) cosine of incidence with the slope between beams, where the surface is glossy."""
        row, column = np.nonzero(glossy[:-1])
        distance = near[row, column]
        fall = np.diff(self.sensor.tangent)[row]
        same = solid[row + 1, column] == solid[row, column]
        slope = np.where(same, (near[row + 1, column] / distance - 1) / fall, 0)
        out = cosine.copy()
        out[row, column] /= np.sqrt(1 + np.square(slope * out[row, column]))
        return out

    def _mix_edges(self, measured: Float32, near: Float32, detected: Bool, chance: Float32) -> None:
        """Mix pixels at edges: some returns lie between the surfaces, some of the nearer surface are late."""
        step = near[:, 1:] - near[:, :-1]
        unmixed = 1 - np.float32(self.sensor.mixed_share)
        row, column = np.nonzero((np.abs(step) > 0.2) & detected[:, 1:] & detected[:, :-1])
        gap = step[row, column]
        luck = chance[row, column + 1]
        mixed = (np.abs(gap) < 2.5) & (luck > unmixed)
        mix = (luck[mixed] - unmixed) / np.float32(self.sensor.mixed_share)
        measured[row[mixed], column[mixed] + 1] -= mix * gap[mixed]
        delayed = luck < unmixed
        row = row[delayed]
        front = (column + (gap < 0))[delayed]  # column of the nearer surface
        delay = -np.log(np.maximum(1 - chance[row, front], np.float32(1e-3)))
        measured[row, front] += np.float32(self.sensor.edge_delay_m) * delay


N_SLICES = 64
"""Number of sectors of a sweep. Nothing moves while one is measured."""


def slice_delay_s(part: int, period_s: float) -> float:
    """Time after the stamp at which a sector is measured [s]; sectors go counter-clockwise from straight ahead."""
    share = (part + 0.5) / N_SLICES
    return (float(share > 0.5) - share) * period_s


@dataclass(frozen=True, slots=True)
class Truth:
    """Ground truth of a sweep."""

    instance: Int  # (N,) body of each point, NONE for the ground
    semantic: Int  # (N,) SemanticKITTI label of each point
    bodies: Int  # (b,) indices of all bodies of annotated kinds, visible or not: their identities
    kinds: tuple[Kind, ...]  # kind of each
    boxes: Float64  # (b, 7) box of each, sensor frame
    points: Int  # (b,) number of points of each in this sweep


class Simulator:
    """Renders sweeps, in any order, each reproducibly by the seed of the noise.

    `distort` leaves the motion of the carrier and the bodies during a sweep in the scans of a rotating sensor; else
    they are as after deskewing.
    """

    def __init__(self, world: World, sensor: SensorModel, seed: int, *, distort: bool = False) -> None:
        self.world = world
        self.sensor = sensor
        self.seed = seed
        self.distort = distort and sensor.rotating
        self.caster = RayCaster(sensor)
        self.receiver = Receiver(sensor, np.random.default_rng([seed, 1]))
        normal = np.random.default_rng([seed, 3]).standard_normal((len(world.bodies), len(BODY_SIGMA)), np.float32)
        self._intensity_offset = normal * BODY_SIGMA
        kinds = [body.kind for body in world.bodies]
        self._annotated = np.flatnonzero([bool(kind.name) for kind in kinds])
        self._kinds = tuple(kind for kind in kinds if kind.name)
        self._labels = np.array([(kind.semantic, kind.moving) for kind in kinds], np.int64).reshape(-1, 2)

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
        distance, intensity, row, column = self.receiver.receive(image.distance, material, image.solid, offset, rng)
        fired = self.sensor.fires(row, column, index)
        row = row[fired]
        column = column[fired]
        points = self._points(distance[row, column], row, column, rng)
        points[:, 3] = intensity[fired]
        # the last solid stands for the ground, whose index is NO_SOLID
        instance = np.append(solids.body, NONE)[image.solid[row, column]]
        if self.distort:
            self._distort(points, column, instance, time_s)
        turn_s = self.sensor.period_s if self.distort else 0.0
        frame = Frame(index, time_s, points, T_world_sensor, turn_s=turn_s)
        return frame, self._truth(time_s, T_world_sensor, instance, material[row, column])

    def _points(self, distance: Float32, row: Int, column: Int, rng: Generator) -> Float32:
        """(n, 4) points, whose intensities are blank, at (n,) horizontal distances along (n,) jittered rays."""
        n = len(row)
        jitter = rng.standard_normal(n, np.float32) * np.float32(self.sensor.azimuth_sigma_rad)
        rise = rng.standard_normal(n, np.float32) * np.float32(self.sensor.elevation_sigma_rad)
        cos = self.caster.cos[column]
        sin = self.caster.sin[column]
        points = np.empty((n, 4), np.float32)
        points[:, 0] = distance * (cos - jitter * sin)
        points[:, 1] = distance * (sin + jitter * cos)
        points[:, 2] = distance * (self.caster.tangent[row, 0] + rise) + self.caster.origin[row, 0]
        return points

    def _distort(self, points: Float32, column: Int, instance: Int, time_s: float) -> None:
        """Move the points of each sector to the sensor frame at the time of its measurement.

        The sensor rotates clockwise, as Velodyne's and Ouster's do, and points straight ahead at the stamp.
        """
        T_world_start = self.world.ego_pose(time_s)
        pose = np.vstack([self.world.poses(time_s), np.zeros(5)])  # the ground, instance NONE, is the last and rests
        heading = pose[instance, 3]
        direction = np.stack([np.cos(heading), np.sin(heading), np.zeros_like(heading)], axis=1)
        velocity = pose[instance, 4, None] * direction
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
        moving = self.world.poses(time_s)[:, 4] > MOVING_MPS
        label = np.append(np.where(moving, self._labels[:, 1], self._labels[:, 0]), 0)[instance]
        points = np.bincount(instance + 1, minlength=len(moving) + 1)[1:]
        return Truth(
            instance=instance,
            semantic=np.where(label > 0, label, SEMANTIC[material]).astype(np.int64),
            bodies=self._annotated,
            kinds=self._kinds,
            boxes=transform_boxes(inverse(T_world_sensor), self.world.boxes(time_s)[self._annotated]),
            points=points[self._annotated],
        )
