"""Returns of a sweep: noise, losses, mixed pixels and intensity."""

from __future__ import annotations

import numpy as np

from modt.types import Bool, Float32, Int
from modt_desk.simulation.materials import DROPOUT, GRAZING_LOSS, INTENSITY, POINT_SIGMA, REFLECTIVITY
from modt_desk.simulation.raycast import Int32
from modt_desk.simulation.sensors import SensorModel
from modt_desk.simulation.terrain import UInt8

GLOSSY = np.float32(0.25)
"""Grazing loss above which the slope between beams counts as well: roofs and bonnets."""


class Receiver:
    """The receiver of a sensor; rng draws the constant errors of its beams."""

    def __init__(self, sensor: SensorModel, rng: np.random.Generator) -> None:
        self.sensor = sensor
        self.bias = rng.normal(0.0, sensor.beam_sigma_m, (sensor.shape[0], 1)).astype(np.float32)
        self.gain = rng.normal(1.0, 0.08, (sensor.shape[0], 1)).astype(np.float32)
        self.secant: Float32 = np.sqrt(1 + np.square(sensor.tangent[:, None]))

    def receive(
        self, distance: Float32, material: UInt8, solid: Int32, offset: Float32, rng: np.random.Generator
    ) -> tuple[Float32, Float32, Int]:
        """(B, A) measured horizontal distances [m], (n,) intensities [0, 1] and (n,) flat indices of the n returns.

        Distance, material and solid are (B, A): the true horizontal distance [m] is infinite without a surface, the
        solid negative for the ground. `offset` (P + 1,) is the intensity of each surface relative to its material;
        the last is the ground's.
        """
        sensor = self.sensor
        chance = rng.random(distance.shape, dtype=np.float32)
        noise = rng.standard_normal(distance.shape, dtype=np.float32)
        hit = np.isfinite(distance)
        near = np.where(hit, distance, np.float32(1e4))
        cosine = self._cos_incidence(near, solid)
        grain = noise[:, ::-1]
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
        ray = np.flatnonzero(detected)
        return measured, sensor.response.report(intensity.ravel().take(ray), slant.ravel().take(ray)), ray

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
        """(B, A) the same cosine, with the slope between beams where the surface is glossy."""
        here = np.flatnonzero(glossy[:-1])
        below = here + near.shape[1]
        s, part, out = near.ravel(), solid.ravel(), cosine.flatten()
        fall = np.diff(self.sensor.tangent)[here // near.shape[1]]
        slope = np.where(part[below] == part[here], (s[below] / s[here] - 1) / fall, 0)
        out[here] /= np.sqrt(1 + np.square(slope * out[here]))
        return out.reshape(near.shape)

    def _mix_edges(self, measured: Float32, near: Float32, detected: Bool, chance: Float32) -> None:
        """Mixed pixels: at edges some returns lie between the surfaces, some of the nearer surface are late."""
        gap = near[:, 1:] - near[:, :-1]
        share = np.float32(self.sensor.mixed_share)
        split = np.flatnonzero((np.abs(gap) > 0.2) & detected[:, 1:] & detected[:, :-1])
        row, column = np.divmod(split, gap.shape[1])
        gap, luck = gap[row, column], chance[row, column + 1]
        mixed = (np.abs(gap) < 2.5) & (luck > 1 - share)
        mix = (luck[mixed] - (1 - share)) / share
        measured[row[mixed], column[mixed] + 1] -= mix * gap[mixed]
        delayed = luck < 1 - share
        row, front = row[delayed], (column + (gap < 0))[delayed]
        delay = -np.log(np.maximum(1 - chance[row, front], np.float32(1e-3)))
        measured[row, front] += np.float32(self.sensor.edge_delay_m) * delay
