"""Rain, snow, fog and dust between a sensor and the surfaces around it.

Sizes and numbers of drops and flakes, extinction and backscatter are published models. What a receiver makes of a
drop in its beam is not published: the efficiencies below set the shares of returns, and are judgement.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.random import Generator
from scipy.special import ndtri

from modt.errors import MisuseError
from modt.geometry import inverse, transform
from modt.types import Float32, Float64
from modt_simulation.options import Condition
from modt_simulation.raycast import RayCaster
from modt_simulation.world import World

BEAM_RADIUS_M = 0.005
"""Radius of a laser beam at its origin [m]."""
BEAM_DIVERGENCE_RAD = 0.0015
"""Growth of the radius with range."""
OVERLAP_M = (0.6, 2.0)
"""Ranges at which the beam enters the view of the receiver, and is in it wholly [m]; nearer echoes are weak."""


@dataclass(frozen=True)
class View:
    """The rays of a sweep.

    Attributes:
        reach_m: (B, A) range of the surface that each ray meets [m], infinite where it meets none.
        detect_m: as in SensorModel; a surface of reflectivity r at normal incidence has a signal of
            10 r (detect_m / range)^2.
        caster: directions of the rays.
        T_world_sensor: (4, 4) pose of the sensor.
        time_s: time of the sweep.
    """

    reach_m: Float32
    detect_m: float
    caster: RayCaster
    T_world_sensor: Float64
    time_s: float


@dataclass(frozen=True)
class Echoes:
    """The strongest echo from the air on each ray.

    Attributes:
        range_m: (B, A) its range [m].
        signal: (B, A) its signal as in View; 0 for none.
        most_intensity: greatest reported intensity.
    """

    range_m: Float32
    signal: Float32
    most_intensity: float


class Air(Protocol):
    """Particles in the air.

    Attributes:
        extinction_per_m: share of the light that is lost on a metre, everywhere.
    """

    @property
    def extinction_per_m(self) -> float:
        """See above."""

    def echoes(self, view: View, rng: Generator) -> Echoes:
        """Echoes from the air in front of the surfaces of a view."""


@dataclass(frozen=True)
class Particles:
    """Drops or flakes with diameters D [mm], of which there are n0 exp(-slope D) a cubic metre and millimetre.

    Rain is that of Marshall and Palmer (1948), snow that of Sekhon and Srivastava (1970), whose diameters are those
    of the melted flakes. Extinction is twice the geometric cross section.

    Attributes:
        n0_per_m3_mm: number of the smallest.
        slope_per_mm: decrease with the diameter.
        swelling: diameter of a particle over that of its drop.
        brightness: reflectivity of a particle times the efficiency of the receiver for it.
        most_m: range within which particles are looked for.
    """

    n0_per_m3_mm: float
    slope_per_mm: float
    swelling: float
    brightness: float
    most_m: float

    LEAST_MM = 0.5  # smaller drops give no echo
    TABLE = 400  # steps of range in a table of volumes

    @property
    def extinction_per_m(self) -> float:
        """Twice the geometric cross section of all particles of a cubic metre."""
        square_mm2 = 2 * self.n0_per_m3_mm / self.slope_per_mm**3
        return float(np.pi / 2 * square_mm2 * self.swelling**2 * 1e-6)

    def echoes(self, view: View, rng: Generator) -> Echoes:
        """Echo of the particle in each beam that returns most."""
        number_per_m3 = self.n0_per_m3_mm / self.slope_per_mm * np.exp(-self.slope_per_mm * self.LEAST_MM)
        ranges_m = np.linspace(0.0, self.most_m, self.TABLE)
        volumes_m3 = _beam_volume_m3(ranges_m)
        reach_m3 = np.interp(np.minimum(view.reach_m.ravel(), self.most_m), ranges_m, volumes_m3)
        number = rng.poisson(number_per_m3 * reach_m3)
        ray = np.repeat(np.arange(len(number)), number)
        range_m = np.interp(rng.random(len(ray)) * reach_m3[ray], volumes_m3, ranges_m)
        diameter_mm = (self.LEAST_MM + rng.exponential(1 / self.slope_per_mm, len(ray))) * self.swelling
        beam_mm = 2e3 * (BEAM_RADIUS_M + BEAM_DIVERGENCE_RAD * range_m)
        covered = np.minimum(np.square(diameter_mm / beam_mm), 1.0)
        signal = self.brightness * covered * 10 * (view.detect_m / np.maximum(range_m, 0.1)) ** 2
        signal *= np.exp(-2 * self.extinction_per_m * range_m) * _overlap(range_m)
        strongest = np.argsort(signal, kind="stable")  # of several on a ray the last one written stays
        best_range_m = np.zeros(len(number))
        best_signal = np.zeros(len(number))
        best_range_m[ray[strongest]] = range_m[strongest]
        best_signal[ray[strongest]] = signal[strongest]
        return _echoes(best_range_m, best_signal, view, most_intensity=0.04)


def _beam_volume_m3(range_m: Float64) -> Float64:
    """Volume of a beam up to a range."""
    a = BEAM_RADIUS_M
    b = BEAM_DIVERGENCE_RAD
    return np.asarray(np.pi * range_m * (a * a + range_m * (a * b + range_m * (b * b / 3))))


def _overlap(range_m: Float64) -> Float64:
    """Share of an echo that the receiver sees."""
    near_m, whole_m = OVERLAP_M
    return np.asarray(np.clip((range_m - near_m) / (whole_m - near_m), 0, 1) ** 2)


def _echoes(range_m: Float64, signal: Float64, view: View, most_intensity: float) -> Echoes:
    shape = view.reach_m.shape
    return Echoes(range_m.astype(np.float32).reshape(shape), signal.astype(np.float32).reshape(shape), most_intensity)


def rain(rate_mm_h: float) -> Particles:
    """Rain of a rate [mm/h]; drops scatter ahead, and return little."""
    return Particles(8000.0, 4.1 * rate_mm_h**-0.21, 1.0, brightness=0.005, most_m=8.0)


def snow(rate_mm_h: float) -> Particles:
    """Snow of a rate [mm/h of water], of flakes of a tenth of the density of water."""
    return Particles(2500.0 * rate_mm_h**-0.94, 2.29 * rate_mm_h**-0.45, 2.15, brightness=0.009, most_m=15.0)


@dataclass(frozen=True)
class Fog:
    """Fog as a soft target, by Rasshofer et al. (2011) and, for its backscatter, Hahner et al. (2021).

    Extinction is ln 20 / visibility (Koschmieder, a contrast of 5 %), backscatter 0.046 / visibility [1/(m sr)].

    Attributes:
        visibility_m: meteorological visibility.
    """

    visibility_m: float

    PULSE_M = 0.9  # length of a pulse, halved
    EFFICIENCY = 0.15  # of a receiver that looks for the peak of a pulse, for the long echo of fog
    SPREAD = 0.7  # standard deviation of the logarithm of the echoes of neighbouring pieces of fog
    PIECE_M = 0.5  # length of a piece
    MOST_M = 16.0  # range within which fog is looked for

    @property
    def extinction_per_m(self) -> float:
        """Koschmieder's."""
        return float(np.log(20) / self.visibility_m)

    def echoes(self, view: View, rng: Generator) -> Echoes:
        """Echo of the piece of fog on each ray that returns most."""
        middle_m = np.arange(1.0, self.MOST_M, self.PIECE_M)
        reflectivity = np.pi * 0.046 / self.visibility_m * self.PULSE_M * self.EFFICIENCY
        mean = reflectivity * 10 * (view.detect_m / middle_m) ** 2 * np.exp(-2 * self.extinction_per_m * middle_m)
        mean *= _overlap(middle_m)
        reach_m = view.reach_m.reshape(-1, 1)
        chance = rng.standard_normal((len(reach_m), len(middle_m)), np.float32)
        spread = np.float32(self.SPREAD)
        signal = mean.astype(np.float32) * np.exp(spread * chance - spread * spread / 2)
        signal[middle_m > reach_m] = 0
        best = signal.argmax(axis=1)
        range_m = middle_m[best] + rng.uniform(-self.PIECE_M / 2, self.PIECE_M / 2, len(best))
        return _echoes(range_m, signal[np.arange(len(best)), best], view, most_intensity=0.05)


@dataclass(frozen=True)
class Dust:
    """Clouds of dust or exhaust that form beside the robot, drift with the wind and thin out.

    A ray ends where it first meets a grain (Beer and Lambert; Phillips, Guenther and McAree, 2017).

    Attributes:
        depth: optical depth of a fresh cloud through its centre.
        world: world in which the robot drives.
        seed: seed of the places of the clouds.
    """

    depth: float
    world: World
    seed: int

    EVERY_S = 3.0  # time between two clouds
    LIFE_S = 5.0  # time until a cloud has gone
    AWAY_M = (2.5, 7.0)  # least and greatest distance from the robot at which a cloud forms
    SIZE_M = (0.8, 0.8, 0.7)  # standard deviation of a fresh cloud along x, y and z
    GROWTH_PER_S = 0.15  # growth of this size
    WIND_MPS = (0.3, 1.0, 0.1)  # drift of a cloud
    ABOVE_M = 0.8  # height of its centre above the ground at first
    REFLECTIVITY = 0.2

    @property
    def extinction_per_m(self) -> float:
        """None outside the clouds."""
        return 0.0

    def echoes(self, view: View, rng: Generator) -> Echoes:
        """Echo of the first grain on each ray."""
        cos = view.caster.cos
        sin = view.caster.sin
        tangent = view.caster.tangent
        ahead = np.stack(np.broadcast_arrays(cos, sin, tangent), axis=2).reshape(-1, 3).astype(np.float64)
        ray = ahead / np.linalg.norm(ahead, axis=1, keepdims=True)
        first_m = np.full(len(ray), np.inf)
        newest = int(view.time_s / self.EVERY_S)
        for number in range(max(0, newest - int(self.LIFE_S / self.EVERY_S)), newest + 1):
            age_s = view.time_s - number * self.EVERY_S
            if age_s < self.LIFE_S:
                first_m = np.minimum(first_m, self._first_grain_m(ray, number, age_s, view, rng))
        hidden = first_m >= view.reach_m.ravel()
        signal = self.REFLECTIVITY * 10 * np.square(view.detect_m / np.maximum(first_m, 0.5))
        return _echoes(first_m, np.where(hidden, 0.0, signal), view, most_intensity=0.15)

    def _first_grain_m(self, ray: Float64, number: int, age_s: float, view: View, rng: Generator) -> Float64:
        """(R,) range at which each of (R, 3) rays meets a cloud [m], infinite where it passes."""
        centre = transform(inverse(view.T_world_sensor), self._centre(number, age_s)[None])[0]
        grown = 1 + self.GROWTH_PER_S * age_s
        size_m = np.array(self.SIZE_M) * grown
        across = ray / size_m
        away = centre / size_m
        square = np.square(across).sum(axis=1)
        nearest_m = across @ away / square
        miss_square = away @ away - np.square(nearest_m) * square
        depth = self.depth / grown * np.exp(-0.5 * miss_square)
        met = rng.standard_exponential(len(ray)) / np.maximum(depth, 1e-9)
        share = np.clip(met, 1e-9, 1 - 1e-9)
        range_m = nearest_m + ndtri(share) / np.sqrt(square)
        return np.where((met < 1) & (range_m > OVERLAP_M[0]), range_m, np.inf)

    def _centre(self, number: int, age_s: float) -> Float64:
        """(3,) centre of a cloud [m, world]."""
        rng = np.random.default_rng([self.seed, 6, number])
        distance_m = rng.uniform(*self.AWAY_M)
        bearing_rad = rng.uniform(0, 2 * np.pi)
        start = self.world.ego_pose(number * self.EVERY_S)[:3, 3] - [0, 0, self.world.height_m - self.ABOVE_M]
        away = distance_m * np.array([np.cos(bearing_rad), np.sin(bearing_rad), 0.0])
        return np.asarray(start + away + age_s * np.array(self.WIND_MPS))


KINDS = {"rain": ("MM_PER_H",), "snow": ("MM_PER_H",), "fog": ("VISIBILITY_M",), "dust": ("OPTICAL_DEPTH",)}
"""Names of the values of each kind of weather."""


def read_weather(text: str) -> Condition:
    """Weather by its text, such as `snow:2.5` or `fog:50@10`.

    Raises:
        MisuseError: the text is no weather.
    """
    condition = Condition.of(text, KINDS)
    if not condition.values[0]:
        raise MisuseError(text, "weather without a strength", "give a value above 0")
    return condition


def weather(condition: Condition, world: World, seed: int) -> Air:
    """Particles in the air of a world."""
    strength = condition.values[0]
    if condition.name == "rain":
        return rain(strength)
    if condition.name == "snow":
        return snow(strength)
    return Fog(strength) if condition.name == "fog" else Dust(strength, world, seed)
