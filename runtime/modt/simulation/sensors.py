"""Sensor models: where the beams of a LiDAR point, how far they see and how well."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.errors import MisuseError
from modt.types import Float32, Float64


@dataclass(frozen=True)
class Response:
    """How a sensor reports the brightness of what it hears.

    Received power is compressed before it is reported: what weakens a return takes off an amount, not a share.

    Attributes:
        near_m, far_m: where a return reads brightest: the sensor's optics are focused there.
        near_loss, far_loss: taken off for every metre nearer or farther.
        least: what is weaker reads 0.
        most: what is stronger reads this.
        steps: from 0 to 1.
    """

    near_m: float = 0.0
    far_m: float = np.inf
    near_loss: float = 0.0
    far_loss: float = 0.0
    least: float = 0.0
    most: float = 1.0
    steps: int = 255

    def report(self, strength: Float32, slant_m: Float32) -> Float32:
        """(n,) brightness read [0, most] of returns that would be as strong as this in focus, at such distances."""
        short, beyond = np.maximum(self.near_m - slant_m, 0), np.maximum(slant_m - self.far_m, 0)
        left = strength - self.near_loss * short - self.far_loss * beyond
        steps = np.rint(np.clip(left, 0, self.most) * self.steps)
        read: Float32 = (steps / self.steps * (left >= self.least)).astype(np.float32)
        return read


@dataclass(frozen=True)
class SensorModel:
    """A LiDAR that samples a grid of beams and azimuths once a sweep.

    Attributes:
        name: for people and for the command line.
        elevation_rad: (B,) of each beam, top to bottom.
        origin_m: (B,) height of each beam's origin above that of the sensor.
        azimuth_rad: (A,) of each column, ascending, counter-clockwise from straight ahead.
        turns: the columns close a circle.
        min_range_m, max_range_m: nearest and farthest return.
        range_sigma_m: noise of a range.
        beam_sigma_m: spread of the constant errors of the beams.
        azimuth_sigma_rad: jitter of a firing.
        detect_m: distance at which half of the returns of a dull surface (reflectivity 0.1) met head-on are lost.
        misfire: share of firings lost whatever they meet.
        spot_m, divergence_rad: radius of a beam where it leaves the sensor, and how it grows with distance.
        smear: share of the returns at a depth edge that lie between both surfaces.
        late_m: mean delay of a return from an edge that splits the beam.
        height_m: usual mounting height above the ground.
        period_s: of a sweep.
        response: what it reports of the strength of a return.
    """

    name: str
    elevation_rad: Float64
    origin_m: Float64
    azimuth_rad: Float64
    turns: bool
    min_range_m: float
    max_range_m: float
    range_sigma_m: float
    beam_sigma_m: float
    azimuth_sigma_rad: float
    detect_m: float
    misfire: float
    spot_m: float
    divergence_rad: float
    smear: float
    late_m: float
    height_m: float
    period_s: float = 0.1
    response: Response = Response()

    @property
    def shape(self) -> tuple[int, int]:
        """Beams and columns."""
        return len(self.elevation_rad), len(self.azimuth_rad)

    @property
    def tangent(self) -> Float32:
        """(B,) rise of each beam over horizontal distance."""
        return np.tan(self.elevation_rad).astype(np.float32)


def _turning(columns: int) -> Float64:
    return np.linspace(0.0, 2 * np.pi, columns, endpoint=False) + np.pi / columns


def _spinner(
    name: str,
    elevation_deg: Float64,
    columns: int,
    max_range_m: float,
    *,
    origin_m: Float64 | None = None,
    min_range_m: float = 0.9,
    range_sigma_m: float = 0.015,
    detect_m: float = 70.0,
    smear: float = 0.12,
    height_m: float = 1.73,
    response: Response = Response(),
) -> SensorModel:
    return SensorModel(
        name=name,
        elevation_rad=np.deg2rad(elevation_deg),
        origin_m=np.zeros(len(elevation_deg)) if origin_m is None else origin_m,
        azimuth_rad=_turning(columns),
        turns=True,
        min_range_m=min_range_m,
        max_range_m=max_range_m,
        range_sigma_m=range_sigma_m,
        beam_sigma_m=0.5 * range_sigma_m,
        azimuth_sigma_rad=0.0003,
        detect_m=detect_m,
        misfire=0.01,
        spot_m=0.02,
        divergence_rad=0.0015,
        smear=smear,
        late_m=0.06,
        height_m=height_m,
        response=response,
    )


def hdl_64e() -> SensorModel:
    """Velodyne HDL-64E at 10 Hz: two blocks of 32 lasers, a third and a half of a degree apart.

    The blocks look out from different heights, so near returns lie higher than the elevations alone would say. Its
    brightness is not made good for distance: half of what is 45 m away reads 0.
    """
    elevation = np.concatenate([np.linspace(1.94, -8.71, 32), np.linspace(-9.03, -25.0, 32)])
    origin = np.concatenate([np.linspace(0.209, 0.198, 32), np.linspace(0.126, 0.116, 32)])
    response = Response(12.0, 17.0, near_loss=0.012, far_loss=0.009, least=0.08, most=0.99, steps=100)
    return _spinner("hdl-64e", elevation, 2083, 80.0, origin_m=origin, min_range_m=2.0, response=response)


def hdl_32e() -> SensorModel:
    """Velodyne HDL-32E at 10 Hz."""
    return _spinner("hdl-32e", np.linspace(10.67, -30.67, 32), 2170, 80.0, height_m=1.5, detect_m=70.0)


def vlp_16() -> SensorModel:
    """Velodyne VLP-16 at 10 Hz."""
    return _spinner("vlp-16", np.linspace(15.0, -15.0, 16), 1808, 90.0, height_m=0.8, min_range_m=0.4, detect_m=70.0)


def ouster_os1(beams: int) -> SensorModel:
    """Ouster OS1 at 10 Hz and 1024 columns."""
    elevation = np.linspace(22.5, -22.5, beams)
    return _spinner(
        f"os1-{beams}", elevation, 1024, 100.0, height_m=1.0, min_range_m=0.4, range_sigma_m=0.02, detect_m=60.0
    )


def solid_state() -> SensorModel:
    """A forward-looking grid of 120 by 25 degrees, as solid-state sensors offer."""
    step = np.deg2rad(0.2)
    return SensorModel(
        name="solid-state",
        elevation_rad=np.deg2rad(np.linspace(7.5, -17.5, 126)),
        origin_m=np.zeros(126),
        azimuth_rad=(np.arange(600) - 299.5) * step,
        turns=False,
        min_range_m=0.5,
        max_range_m=150.0,
        range_sigma_m=0.02,
        beam_sigma_m=0.005,
        azimuth_sigma_rad=0.0002,
        detect_m=120.0,
        misfire=0.005,
        spot_m=0.005,
        divergence_rad=0.001,
        smear=0.15,
        late_m=0.04,
        height_m=1.0,
    )


SENSORS = {
    "hdl-64e": hdl_64e,
    "hdl-32e": hdl_32e,
    "vlp-16": vlp_16,
    "os1-32": lambda: ouster_os1(32),
    "os1-64": lambda: ouster_os1(64),
    "os1-128": lambda: ouster_os1(128),
    "solid-state": solid_state,
}


def sensor(name: str) -> SensorModel:
    """A sensor model by its name.

    Raises:
        MisuseError: there is none of that name.
    """
    if name not in SENSORS:
        raise MisuseError(name, "no such sensor model", f"use one of {', '.join(SENSORS)}")
    return SENSORS[name]()
