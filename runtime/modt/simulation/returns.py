"""From what the rays meet to what a sensor reports: noise, losses, partial returns and brightness."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from modt.simulation.materials import GLOSS, LEVEL, LOSS, REFLECTIVITY, TEXTURE
from modt.simulation.sensors import SensorModel
from modt.types import Bool, Float32, Int

SHINY = np.float32(0.25)
"""Loss towards grazing from which on the slope from beam to beam counts as well: roofs and bonnets."""


class Receiver:
    """The receiving half of a sensor.

    Args:
        sensor: its model.
        rng: for the constant errors of its beams.
    """

    def __init__(self, sensor: SensorModel, rng: np.random.Generator) -> None:
        self.sensor = sensor
        self.bias = rng.normal(0.0, sensor.beam_sigma_m, (sensor.shape[0], 1)).astype(np.float32)
        self.gain = rng.normal(1.0, 0.08, (sensor.shape[0], 1)).astype(np.float32)
        self.secant: Float32 = np.sqrt(1 + np.square(sensor.tangent[:, None]))

    def receive(
        self,
        distance: Float32,
        material: NDArray[np.uint8],
        group: NDArray[np.int32],
        shade: Float32,
        rng: np.random.Generator,
    ) -> tuple[Float32, Float32, Int]:
        """Distance [m, horizontal] of every ray, brightness of those that return [0, 1], and which (flat) these are.

        Args:
            distance: (B, A) horizontal distance met [m], infinite where nothing was.
            material: (B, A) of the surface met.
            group: (B, A) which surface it is, to tell an edge from a slope.
            shade: (P + 1,) how much brighter than others of its material each surface is; the last is the ground.
            rng: of this sweep.
        """
        sensor = self.sensor
        chance = rng.random(distance.shape, dtype=np.float32)
        noise = rng.standard_normal(distance.shape, dtype=np.float32)
        met = np.isfinite(distance)
        near = np.where(met, distance, np.float32(1e4))
        head_on = self._incidence(near, group)
        grain = noise[:, ::-1]
        reflectivity = REFLECTIVITY.take(material) * self.gain * (1 + np.float32(0.15) * grain)
        slant = near * self.secant
        signal = reflectivity * head_on * np.float32(10 * sensor.detect_m**2) / (slant * slant)
        lost = LOSS.take(material) + np.float32(sensor.misfire)
        heard = met & (chance > lost + (1 - lost) / (1 + signal * signal))
        heard &= (slant > sensor.min_range_m) & (slant < sensor.max_range_m)
        ranged: Float32 = (
            near + (self.bias + np.float32(sensor.range_sigma_m) * noise).astype(np.float32) / self.secant
        )
        self._smear(ranged, near, heard, chance)
        strength = self._strength(near, material, group, shade, head_on)
        strength += TEXTURE.take(material) * grain
        ray = np.flatnonzero(heard)
        return ranged, sensor.response.report(strength.ravel().take(ray), slant.ravel().take(ray)), ray

    def _strength(
        self, near: Float32, material: NDArray[np.uint8], group: NDArray[np.int32], shade: Float32, head_on: Float32
    ) -> Float32:
        """(B, A) brightness of every surface as it is met, in focus."""
        strength: Float32 = LEVEL.take(material)
        strength *= self.gain
        strength += shade.take(group, mode="wrap")
        gloss = GLOSS.take(material)
        strength -= gloss * (1 - self._from_above(near, group, head_on, gloss > SHINY))
        return strength

    def _incidence(self, near: Float32, group: NDArray[np.int32]) -> Float32:
        """Cosine of the angle at which each surface is met, from the slope of the range image along the beam."""
        step = np.float32(self.sensor.azimuth_rad[1] - self.sensor.azimuth_rad[0])
        slope = np.zeros_like(near)
        np.subtract(near[:, 1:], near[:, :-1], out=slope[:, 1:])
        same = np.zeros(near.shape, np.bool_)
        np.equal(group[:, 1:], group[:, :-1], out=same[:, 1:])
        slope /= near * step
        level = 1 / np.sqrt(1 + slope * slope)
        ground = group < 0
        tangent = np.abs(self.sensor.tangent[:, None]) / self.secant
        return np.where(ground, tangent + np.float32(0.05), np.where(same, level, np.float32(0.7))).astype(np.float32)

    def _from_above(self, near: Float32, group: NDArray[np.int32], head_on: Float32, shiny: Bool) -> Float32:
        """The same cosine, that of shiny surfaces with the slope from beam to beam as well."""
        here = np.flatnonzero(shiny[:-1])
        below = here + near.shape[1]
        s, part, cosine = near.ravel(), group.ravel(), head_on.flatten()
        fall = np.diff(self.sensor.tangent)[here // near.shape[1]]
        slope = np.where(part[below] == part[here], (s[below] / s[here] - 1) / fall, 0)
        cosine[here] /= np.sqrt(1 + np.square(slope * cosine[here]))
        return cosine.reshape(near.shape)

    def _smear(self, ranged: Float32, near: Float32, heard: Bool, chance: Float32) -> None:
        """Where a beam is split by an edge, some returns mix both surfaces and some of the nearer one come late."""
        gap = near[:, 1:] - near[:, :-1]
        share = np.float32(self.sensor.smear)
        split = np.flatnonzero((np.abs(gap) > 0.2) & heard[:, 1:] & heard[:, :-1])
        row, column = np.divmod(split, gap.shape[1])
        gap, luck = gap[row, column], chance[row, column + 1]
        mixed = (np.abs(gap) < 2.5) & (luck > 1 - share)
        mix = (luck[mixed] - (1 - share)) / share
        ranged[row[mixed], column[mixed] + 1] -= mix * gap[mixed]
        behind = luck < 1 - share
        row, front = row[behind], (column + (gap < 0))[behind]
        late = -np.log(np.maximum(1 - chance[row, front], np.float32(1e-3)))
        ranged[row, front] += np.float32(self.sensor.late_m) * late
