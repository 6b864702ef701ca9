"""Sweeps of a sensor in a world: noise, losses, mixed pixels, intensity, and the ground truth of every point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.random import Generator

from modt.geometry import inverse, transform_boxes
from modt.types import NONE, Bool, Float32, Float64, Frame, Int, Self
from modt_simulation.faults import faulty
from modt_simulation.kinds import Kind
from modt_simulation.materials import (
    BODY_SIGMA,
    DROPOUT,
    GLOSSY_REFLECTIVITY,
    GRAZING_LOSS,
    INTENSITY,
    POINT_SIGMA,
    REFLECTIVITY,
    SEMANTIC,
)
from modt_simulation.options import Condition
from modt_simulation.raycast import NO_SOLID, Int32, RayCaster
from modt_simulation.sensors import SensorModel
from modt_simulation.terrain import UInt8
from modt_simulation.weather import Air, View, weather
from modt_simulation.world import MOVING_MPS, World

N_SECTORS = 32
"""Number of sectors of a distorted sweep. Nothing moves while one is measured."""


def sector_delay_s(part: int, period_s: float) -> float:
    """Time after the stamp at which a sector is measured [s]; sectors go counter-clockwise from straight ahead."""
    share = (part + 0.5) / N_SECTORS
    return (float(share > 0.5) - share) * period_s


@dataclass(frozen=True)
class Sector:
    """Neighbouring columns of a sensor that are measured at one time."""

    columns: slice
    delay_s: float  # time after the stamp
    caster: RayCaster

    @classmethod
    def of(cls, sensor: SensorModel, *, turning: bool) -> list[Self]:
        """The sectors of a head that turns clockwise and points straight ahead at the stamp, else a single one.

        The sweep of a turning head begins and ends behind the sensor, in the sensor's own azimuth.
        """
        if not turning:
            return [cls(slice(0, sensor.shape[1]), 0.0, RayCaster(sensor))]
        edges = np.linspace(0, sensor.shape[1], N_SECTORS + 1).round().astype(int).tolist()
        sectors = []
        for part, (first, end) in enumerate(pairwise(edges)):
            columns = slice(first, end)
            caster = RayCaster(replace(sensor, azimuth_rad=sensor.azimuth_rad[columns]))
            sectors.append(cls(columns, sector_delay_s(part, sensor.period_s), caster))
        return sectors


@dataclass(frozen=True)
class Surfaces:
    """First hits of the rays of a sweep, or of a sector of it."""

    distance: Float32  # (B, A) true horizontal distance [m]; infinite without a surface
    material: UInt8  # (B, A) its material
    solid: Int32  # (B, A) index of the solid hit, negative for the ground
    body: Int  # (P,) body of each solid
    offset: Float32  # (P,) intensity of each solid relative to its material

    @classmethod
    def join(cls, sectors: Sequence[Self]) -> Self:
        """The sweep of neighbouring sectors, whose solids are numbered on."""
        before = np.cumsum([0, *(len(sector.body) for sector in sectors)])[:-1]
        solid = [np.where(s.solid < 0, s.solid, s.solid + n) for s, n in zip(sectors, before.tolist(), strict=True)]
        return cls(
            distance=np.concatenate([sector.distance for sector in sectors], axis=1),
            material=np.concatenate([sector.material for sector in sectors], axis=1),
            solid=np.concatenate(solid, axis=1).astype(np.int32),
            body=np.concatenate([sector.body for sector in sectors]),
            offset=np.concatenate([sector.offset for sector in sectors]),
        )


@dataclass(frozen=True)
class Returns:
    """Returns of a receiver for the rays of a sweep."""

    distance: Float32  # (B, A) measured horizontal distance [m]
    signal: Float32  # (B, A) strength of the return, as in View; 0 for none
    intensity: Float32  # (B, A) reported intensity [0, 1]


GLOSSY = np.float32(0.25)
"""Grazing loss above which the slope between beams counts as well, as on roofs and bonnets."""
AIR_SEMANTIC = 1
"""SemanticKITTI label of an outlier, which every return of rain, snow, fog and dust has."""


class Receiver:
    """The receiver of a sensor; rng draws the constant errors of its beams, `reflectivity` is that by material."""

    def __init__(self, sensor: SensorModel, rng: Generator, reflectivity: Float32) -> None:
        self.sensor = sensor
        self.reflectivity = reflectivity
        self.bias = rng.normal(0.0, sensor.beam_sigma_m, (sensor.shape[0], 1)).astype(np.float32)
        self.gain = rng.normal(1.0, 0.08, (sensor.shape[0], 1)).astype(np.float32)
        self.secant: Float32 = np.sqrt(1 + np.square(sensor.tangent[:, None]))

    def receive(self, seen: Surfaces, rng: Generator, extinction_per_m: float = 0.0) -> Returns:
        """Noisy returns of the surfaces of a sweep, through air in which light is lost."""
        sensor = self.sensor
        distance = seen.distance
        material = seen.material
        solid = seen.solid
        chance = rng.random(distance.shape, dtype=np.float32)
        noise = rng.standard_normal(distance.shape, dtype=np.float32)
        hit = np.isfinite(distance)
        near = np.where(hit, distance, np.float32(1e4))
        cosine = self._cos_incidence(near, solid)
        grain = noise[:, ::-1]  # a second sequence of random numbers, for the surface
        reflectivity = self.reflectivity.take(material) * self.gain * (1 + np.float32(0.15) * grain)
        slant = near * self.secant
        signal = reflectivity * cosine * np.float32(10 * sensor.detect_m**2) / (slant * slant)
        if extinction_per_m:
            signal *= np.exp(np.float32(-2 * extinction_per_m) * slant)
        lost = DROPOUT.take(material) + np.float32(sensor.dropout)
        detected = hit & (chance > lost + (1 - lost) / (1 + signal * signal))
        detected &= (slant > sensor.min_range_m) & (slant < sensor.max_range_m)
        error = (self.bias + np.float32(sensor.range_sigma_m) * noise).astype(np.float32)
        measured: Float32 = near + error / self.secant
        self._mix_edges(measured, near, detected, chance)
        intensity: Float32 = INTENSITY.take(material) * self.gain
        intensity += np.append(seen.offset, np.float32(0)).take(solid, mode="wrap")  # the last is the ground's
        loss = GRAZING_LOSS.take(material)
        intensity -= loss * (1 - self._cos_glossy(near, solid, cosine, loss > GLOSSY))
        intensity += POINT_SIGMA.take(material) * grain
        intensity[detected] = sensor.response.report(intensity[detected], slant[detected])
        return Returns(measured, np.where(detected, signal, np.float32(0)), intensity)

    def receive_air(self, returns: Returns, air: Air, view: View, rng: Generator) -> Bool:
        """Put the echoes from the air in the place of weaker returns; (B, A) whether the return is one of the air."""
        echoes = air.echoes(view, rng)
        signal = echoes.signal
        square = np.square(signal)
        wins: Bool = (signal > returns.signal) & (rng.random(signal.shape, np.float32) * (1 + square) < square)
        wins &= echoes.range_m > self.sensor.min_range_m
        error = np.float32(self.sensor.range_sigma_m) * rng.standard_normal(signal.shape, np.float32)
        intensity = np.float32(echoes.most_intensity) * rng.random(signal.shape, np.float32)
        np.copyto(returns.distance, (echoes.range_m + error) / self.secant, where=wins)
        np.copyto(returns.signal, signal, where=wins)
        np.copyto(returns.intensity, intensity * bool(self.sensor.response.most), where=wins)
        return wins

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


@dataclass(frozen=True)
class Truth:
    """Ground truth of a sweep."""

    instance: Int  # (N,) body of each point, NONE for the ground
    semantic: Int  # (N,) SemanticKITTI label of each point
    bodies: Int  # (b,) indices of all bodies of annotated kinds, visible or not: their identities
    kinds: tuple[Kind, ...]  # kind of each
    world_boxes: Float64  # (b, 7) box of each, upright in the world
    T_world_sensor: Float64  # (4, 4) pose of the sensor at the stamp
    points: Int  # (b,) number of points of each in this sweep

    @property
    def boxes(self) -> Float64:
        """(b, 7) box of each in the sensor frame, as if the sensor stood upright."""
        return transform_boxes(inverse(self.T_world_sensor), self.world_boxes)


class Simulator:
    """Renders sweeps, in any order, each reproducibly by the seed of the noise.

    `distort` leaves the motion of the carrier and the bodies during a sweep in the scans of a rotating sensor: every
    sector is seen from the pose at its own time. Else they are as after deskewing. `glossy` makes the paint of cars
    mirror most of the light away. Weather and faults of the sensor change the sweeps from the time on at which they
    begin. The first sweep is at `first_s`. The seed of the noise of a receiver may differ from that of the bodies.
    """

    def __init__(
        self,
        world: World,
        sensor: SensorModel,
        seed: int,
        *,
        distort: bool = False,
        glossy: bool = False,
        weather: Condition | None = None,
        faults: Sequence[Condition] = (),
        first_s: float = 0.0,
        noise_seed: int | None = None,
    ) -> None:
        self.world = world
        self.sensor = sensor
        self.seed = seed
        self._first_s = first_s
        self._noise_seed = seed if noise_seed is None else noise_seed
        self.distort = distort and sensor.rotating
        self.caster = RayCaster(sensor)
        self._sectors = Sector.of(sensor, turning=self.distort)
        self._reflectivity = GLOSSY_REFLECTIVITY if glossy else REFLECTIVITY
        self._weather = weather
        self._faults = faults
        faulty(sensor, faults, np.inf)  # refuses what this sensor cannot have
        normal = np.random.default_rng([seed, 3]).standard_normal((len(world.bodies), len(BODY_SIGMA)), np.float32)
        self._intensity_offset = normal * BODY_SIGMA
        kinds = [body.kind for body in world.bodies]
        self._annotated = np.flatnonzero([bool(kind.name) for kind in kinds])
        self._kinds = tuple(kind for kind in kinds if kind.name)
        self._labels = np.array([(kind.semantic, kind.moving) for kind in kinds], np.int64).reshape(-1, 2)

    def sweep(self, index: int) -> tuple[Frame, Truth]:
        """Frame number index and its ground truth."""
        rng = np.random.default_rng([self._noise_seed, 2, index])
        time_s = self._first_s + index * self.sensor.period_s
        depth = rng.standard_exponential(self.sensor.shape, np.float32)
        seen = Surfaces.join([self._surfaces(sector, time_s, depth) for sector in self._sectors])
        sensor = faulty(self.sensor, self._faults, time_s)
        receiver = Receiver(sensor, np.random.default_rng([self._noise_seed, 1]), self._reflectivity)
        T_world_sensor = self.world.ego_pose(time_s)
        air = self._air(time_s)
        returns = receiver.receive(seen, rng, air.extinction_per_m if air else 0.0)
        of_air = np.zeros(sensor.shape, np.bool_)
        if air is not None:
            view = View(seen.distance * receiver.secant, sensor.detect_m, self.caster, T_world_sensor, time_s)
            of_air = receiver.receive_air(returns, air, view, np.random.default_rng([self.seed, 5, index]))
        row, column = np.nonzero(returns.signal)
        fired = sensor.fires(row, column, index)
        row = row[fired]
        column = column[fired]
        points = self._points(returns.distance[row, column], row, column, rng)
        points[:, 3] = returns.intensity[row, column]
        # the last solid stands for the ground, whose index is NO_SOLID
        instance = np.where(of_air, NONE, np.append(seen.body, NONE)[seen.solid])[row, column]
        turn_s = self.sensor.period_s if self.distort else 0.0
        frame = Frame(index, time_s, points, T_world_sensor, turn_s=turn_s)
        truth = self._truth(time_s, T_world_sensor, instance, seen.material[row, column])
        truth.semantic[of_air[row, column]] = AIR_SEMANTIC
        return frame, truth

    def _air(self, time_s: float) -> Air | None:
        """Particles in the air at a time, None while it is clear."""
        if self._weather is None or time_s < self._weather.from_s:
            return None
        return weather(self._weather, self.world, self.seed)

    def _surfaces(self, sector: Sector, time_s: float, depth: Float32) -> Surfaces:
        """Hits of the rays of a sector in a sweep; `depth` (B, A) is that of all columns, as in RayCaster.cast."""
        T_world_sensor = self._ego_pose(time_s, sector.delay_s)
        solids = self.world.solids(time_s + sector.delay_s, T_world_sensor, self.sensor.max_range_m)
        solids = solids.widened_by_beam(self.sensor.beam_radius_m, self.sensor.divergence_rad)
        ground, ground_material = self.world.terrain.cast(sector.caster, T_world_sensor)
        image = sector.caster.cast(solids, ground, depth[:, sector.columns])
        of_solid = np.append(solids.material, 0).astype(np.uint8)
        material = np.where(image.solid != NO_SOLID, of_solid[image.solid], ground_material)
        offset = self._intensity_offset[solids.body, solids.material]
        return Surfaces(image.distance, material, image.solid, solids.body, offset)

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

    def _ego_pose(self, time_s: float, delay_s: float) -> Float64:
        """(4, 4) T_world_sensor after a delay, extrapolated before the start of the drive."""
        if time_s + delay_s >= 0.0:
            return self.world.ego_pose(time_s + delay_s)
        T = self.world.ego_pose(time_s)
        return T @ inverse(self.world.ego_pose(time_s - delay_s)) @ T

    def _truth(self, time_s: float, T_world_sensor: Float64, instance: Int, material: UInt8) -> Truth:
        moving = self.world.poses(time_s)[:, 4] > MOVING_MPS
        label = np.append(np.where(moving, self._labels[:, 1], self._labels[:, 0]), 0)[instance]
        points = np.bincount(instance + 1, minlength=len(moving) + 1)[1:]
        return Truth(
            instance=instance,
            semantic=np.where(label > 0, label, SEMANTIC[material]).astype(np.int64),
            bodies=self._annotated,
            kinds=self._kinds,
            world_boxes=self.world.boxes(time_s)[self._annotated],
            T_world_sensor=T_world_sensor,
            points=points[self._annotated],
        )
