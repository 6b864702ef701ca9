"""Table of the simulated sensors: beams, range, noise and intensity response."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from modt import profile
from modt.errors import MisuseError
from modt.types import Bool, Float32, Float64, Int

COLUMN_STEP = (np.sqrt(5) - 1) / 2
"""Step of the fired ray of a non-repetitive sensor from column to column, a share of its rays; irrational."""
SWEEP_STEP = np.sqrt(2) - 1
"""Step of the fired ray from sweep to sweep, a share of its rays; irrational."""


@dataclass(frozen=True)
class Response:
    """Intensity that a sensor reports.

    Received power is compressed logarithmically: attenuation subtracts from the intensity.
    """

    near_m: float = 0.0  # least range in focus of the optics
    far_m: float = np.inf  # greatest range in focus of the optics
    near_loss: float = 0.0  # subtracted per metre nearer [1/m]
    far_loss: float = 0.0  # subtracted per metre farther [1/m]
    least: float = 0.0  # lower intensities are reported as 0
    most: float = 1.0  # greatest reported intensity
    steps: int = 255  # steps of the scale from 0 to 1

    def report(self, intensity: Float32, range_m: Float32) -> Float32:
        """(n,) reported intensities [0, most] of returns by their intensities in focus and their ranges."""
        near_loss = self.near_loss * np.maximum(self.near_m - range_m, 0)
        left = intensity - near_loss - self.far_loss * np.maximum(range_m - self.far_m, 0)
        steps = np.rint(np.clip(left, 0, self.most) * self.steps)
        return np.asarray((steps / self.steps * (left >= self.least)).astype(np.float32))


@dataclass(frozen=True, kw_only=True)
class SensorModel:
    """A LiDAR that samples a grid of beams and azimuths, by default one that rotates at 10 Hz."""

    name: str  # name of the sensor and of its profile
    elevation_rad: Float64  # (B,) elevations of the beams, descending
    azimuth_rad: Float64  # (A,) azimuths of the columns, ascending, counter-clockwise from straight ahead
    origin_m: Float64 | float = 0.0  # (B,) height of each beam's origin above the sensor's, or one for all
    rotating: bool = True  # a sweep is one turn of the columns
    sweeps_a_ray: int = 1  # sweeps in which each ray is fired once; more than 1 if non-repetitive
    height_m: float  # usual mounting height above the ground
    min_range_m: float  # least range of a return
    max_range_m: float  # greatest range of a return
    range_sigma_m: float = 0.015  # noise of a range
    beam_sigma_m: float = 0.0075  # standard deviation of the constant range errors of the beams
    azimuth_sigma_rad: float = 0.0003  # jitter of a firing
    elevation_sigma_rad: float = 0.0  # jitter of a firing in elevation
    detect_m: float = 70.0  # distance at which half the returns of a reflectivity of 0.1 at normal incidence are lost
    dropout: float = 0.01  # share of firings lost on any surface
    beam_radius_m: float = 0.02  # radius of a beam at its origin
    divergence_rad: float = 0.0015  # growth of the radius with range
    mixed_share: float = 0.12  # share of the returns at a depth edge that lie between the surfaces
    edge_delay_m: float = 0.06  # mean range error of a return from an edge that splits the beam
    period_s: float = 0.1  # time of a sweep
    response: Response = Response()  # reported intensity
    blind: Bool | None = None  # (B, A) rays that give no return, of dead lasers and covered sectors

    @property
    def shape(self) -> tuple[int, int]:
        """Beams and columns."""
        return len(self.elevation_rad), len(self.azimuth_rad)

    @property
    def tangent(self) -> Float32:
        """(B,) rise of each beam over horizontal distance."""
        return np.tan(self.elevation_rad).astype(np.float32)

    def fires(self, row: Int, column: Int, sweep: int) -> Bool:
        """(n,) whether the rays at (n,) beams and columns are fired in a sweep, and not blind."""
        offset = np.floor((COLUMN_STEP * column + SWEEP_STEP * sweep) % 1 * self.sweeps_a_ray)
        fired = np.asarray(row % self.sweeps_a_ray == offset)
        return fired if self.blind is None else fired & ~self.blind[row, column]


def _beams(top_deg: float, bottom_deg: float, n: int) -> Float64:
    return np.deg2rad(np.linspace(top_deg, bottom_deg, n))


def _columns(n: int) -> Float64:
    return np.linspace(0.0, 2 * np.pi, n, endpoint=False) + np.pi / n


def _beams_of(profile_name: str) -> Float64:
    """Elevations of unevenly spaced beams, as the sensor's profile states them."""
    elevations_deg = profile.load(profile_name).sensor.elevations_deg
    assert elevations_deg is not None
    return np.asarray(np.deg2rad(elevations_deg))


def _rotating(
    name: str, elevation_rad: Float64, columns: int, height_m: float, range_m: tuple[float, float], **more: Any
) -> SensorModel:
    """A rotating sensor, its least and greatest range, and what differs from the defaults."""
    return SensorModel(
        name=name,
        elevation_rad=elevation_rad,
        azimuth_rad=_columns(columns),
        height_m=height_m,
        min_range_m=range_m[0],
        max_range_m=range_m[1],
        **more,
    )


_MODELS = (
    # Two blocks of 32 lasers at different heights. The intensity is not corrected for range: half of it is 0 at 45 m.
    _rotating(
        "hdl-64e",
        np.append(_beams(1.94, -8.71, 32), _beams(-9.03, -25.0, 32)),
        2083,
        1.73,
        (2.0, 80.0),
        origin_m=np.append(np.linspace(0.209, 0.198, 32), np.linspace(0.126, 0.116, 32)),
        response=Response(12.0, 17.0, near_loss=0.012, far_loss=0.009, least=0.08, most=0.99, steps=100),
    ),
    _rotating("hdl-32e", _beams(10.67, -30.67, 32), 2170, 1.5, (0.9, 80.0)),
    _rotating("vlp-16", _beams(15.0, -15.0, 16), 1808, 0.8, (0.4, 90.0)),
    _rotating("vlp-32c", _beams_of("vlp-32c"), 1808, 1.5, (0.9, 100.0)),
    # The intensities of materials are unknown on the scale of this sensor: it reports 0.
    _rotating("pandar64", _beams_of("pandar64"), 1800, 2.1, (0.9, 100.0), response=Response(most=0.0)),
    _rotating("xt-32", _beams(15.0, -16.0, 32), 2000, 0.8, (0.3, 100.0), range_sigma_m=0.01, beam_sigma_m=0.005),
    *(
        _rotating(
            f"os1-{n}",
            _beams(22.5, -22.5, n),
            1024,
            1.0,
            (0.4, 100.0),
            range_sigma_m=0.02,
            beam_sigma_m=0.01,
            detect_m=60.0,
        )
        for n in (32, 64, 128)
    ),
    # 200,000 points a second. The grid is finer than the spacing of one sweep, which takes each 17th ray.
    SensorModel(
        name="mid-360",
        elevation_rad=_beams(52.0, -7.0, 237),
        azimuth_rad=_columns(1440),
        rotating=False,
        sweeps_a_ray=17,
        elevation_sigma_rad=0.0018,
        height_m=0.5,
        min_range_m=0.1,
        max_range_m=70.0,
        range_sigma_m=0.02,
        beam_sigma_m=0.0,
        detect_m=40.0,
    ),
    SensorModel(
        name="solid-state",
        elevation_rad=_beams(7.5, -17.5, 126),
        azimuth_rad=(np.arange(600) - 299.5) * np.deg2rad(0.2),
        rotating=False,
        height_m=1.0,
        min_range_m=0.5,
        max_range_m=150.0,
        range_sigma_m=0.02,
        beam_sigma_m=0.005,
        azimuth_sigma_rad=0.0002,
        detect_m=120.0,
        dropout=0.005,
        beam_radius_m=0.005,
        divergence_rad=0.001,
        mixed_share=0.15,
        edge_delay_m=0.04,
    ),
)
SENSORS = {model.name: model for model in _MODELS}


def sensor(name: str) -> SensorModel:
    """A sensor model by name.

    Raises:
        MisuseError: there is none of that name.
    """
    if name not in SENSORS:
        raise MisuseError(name, "no such sensor model", f"use one of {', '.join(SENSORS)}")
    return SENSORS[name]
