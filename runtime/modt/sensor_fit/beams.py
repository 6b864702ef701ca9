"""Elevations of a sensor's beams, found in its points.

Points of a beam lie on a cone: z = height of its origin + range * tangent of its elevation. Each beam is a peak in
the histogram of the tangents. Compensation for motion blurs the peak, and so does an origin apart from that of the
frame. Several heights of the origin are tried, and each point takes the one with the highest peaks around it (Hough
transform).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from modt import assets, profile
from modt.config import SegmentationConfig, SensorConfig
from modt.types import Bool, Float32, Float64, Int, Self

_GAUSSIAN_REACH = 4.0
"""Half width of a Gaussian [standard deviations]. Filtered rows continue mirrored beyond their ends."""


def gaussian(values: Float64, deviation: float) -> Float64:
    """Mean weighted by a Gaussian of this standard deviation."""
    reach = int(_GAUSSIAN_REACH * deviation + 0.5)
    weights = np.exp(-0.5 / (deviation * deviation) * np.arange(-reach, reach + 1) ** 2)
    weights /= weights.sum()
    padded = np.pad(values, reach, "symmetric")
    n = len(values)
    smooth: Float64 = values * weights[reach]
    for k in range(reach):
        smooth += (padded[k : k + n] + padded[2 * reach - k : 2 * reach - k + n]) * weights[k]
    return smooth


def running_mean(values: Float64, width: int) -> Float64:
    """Mean of windows of a width; windows of even width begin one value earlier."""
    padded = np.pad(values, (width // 2, (width - 1) // 2), "symmetric")
    first = padded[:width].cumsum()[-1:]
    return np.asarray(np.concatenate([first, padded[width:] - padded[:-width]]).cumsum() / width)


def prominent_peaks(count: Float64) -> tuple[Int, Float64]:
    """(B,) bins of the local maxima, in the middle of a plateau, and (B,) prominence of each.

    The prominence of a peak is its height above the higher of the two valleys that part it from higher ground.
    """
    starts = np.flatnonzero(np.diff(count, prepend=np.nan) != 0)
    ends = np.append(starts[1:], len(count)) - 1
    height = count[starts]
    inner = 1 + np.flatnonzero((height[1:-1] > height[:-2]) & (height[1:-1] > height[2:]))
    valleys = [max(_valley(height[i::-1]), _valley(height[i:])) for i in inner.tolist()]
    return (starts[inner] + ends[inner]) // 2, height[inner] - np.array(valleys, np.float64)


def _valley(height: Float64) -> float:
    """Lowest value before the row rises above its first value."""
    higher = int(np.argmax(height > height[0]))
    return float(height[: higher or None].min())


BIN = np.deg2rad(0.01)
"""Width of a bin of the histogram of tangents."""
STEEPEST = 2.75
"""Greatest tangent in the histogram, which is that of 70 degrees."""
N_BINS = int(2 * STEEPEST / BIN)
SMOOTH_BINS = 2.0
"""Standard deviation of the smoothing [bins]."""
WINDOW_BINS = 250
"""Half the window around a point in which the peaks of an origin are compared [bins]."""
ORIGINS_M = np.arange(0.0, 0.26, 0.01)
"""Tried heights of the beams' origin above that of the frame [m]."""
COARSE_ORIGINS_M = ORIGINS_M[::2]
"""Tried heights of that origin for a single sweep, in which time counts [m]."""
FRAME_ORIGIN_FAVOUR = 1.1
"""Factor on the peaks of the frame's own origin."""
MIN_POINTS = 1000
"""Fewest points in which beams are searched."""
ASIDE = np.tan(np.deg2rad(60.0))
"""Points with a steeper bearing lie to the side, where compensation for a drive ahead moves them along their ring."""
MIN_ASIDE = 0.1
"""Share of the points to the side from which the other points are left out."""
MIN_RANGE_M = 1.0
"""Nearer points may lie on the robot [m]."""
FULL_WEIGHT_M = 20.0
"""Points beyond it have the full weight; errors of position blur nearer ones [m]."""
MIN_PROMINENCE = 0.35
"""Least prominence of a peak, as a share of its height."""
MIN_MASS = 3e-4
"""Least share of all points on a beam."""
MIN_GAP = 0.5
"""Least gap between beams, as a share of the median of the gaps around."""
GAPS_AROUND = 7
"""Number of gaps of which that median is taken."""
MIN_CONTRAST = 0.6
"""A sensor has beams if this share of the points lies in the peaks, above the valleys."""
ONE_ORIGIN_CONTRAST = 0.995
"""Other origins are tried below this share."""
MAX_BEAMS = 512
MAX_ASPECT = 8.0
"""Greatest azimuth step over the spacing of beams; beyond it the peaks are chance."""
CELL_DEG = (2.0, 4.0)
"""Size in elevation and azimuth of a cell in which returns are counted [deg]."""
FULL_QUANTILE = 0.75
"""Quantile of those counts that is the count of a cell in which every firing returns. Skies are emptier, and fog,
snow and dust fill them in part."""


@dataclass(frozen=True)
class BeamPattern:
    """Beams of a sensor, or the mean spacing of its returns where it has no beams.

    Attributes:
        elevations_deg: (B,) elevations, ascending; empty without beams.
        spacing_deg: median step between neighbouring beams; without beams that between neighbouring returns.
        azimuth_step_deg: step between neighbouring returns of a beam.
        contrast: share of the points in the peaks of the beams, above the valleys; 0 without beams.
    """

    elevations_deg: Float64
    spacing_deg: float
    azimuth_step_deg: float
    contrast: float = 0.0


def can_show_beams(points: Float32) -> bool:
    """Whether (N, 4) points of a sweep are enough to find its beams."""
    return int(np.count_nonzero(_far(points))) >= MIN_POINTS


def _far(points: Float32) -> Bool:
    """(N,) points beyond MIN_RANGE_M."""
    far: Bool = np.hypot(points[:, 0], points[:, 1]) > MIN_RANGE_M
    return far


def find_beams(sweeps: Sequence[Float32], origins_m: Float64 = ORIGINS_M) -> BeamPattern | None:
    """Beams of sweeps of (N, 4) points; None if there are too few points.

    Args:
        sweeps: points of each [m], level or not.
        origins_m: tried heights of the beams' origin above that of the frame; the first one is the frame's own.
    """
    used = [points[_far(points)] for points in sweeps]
    if sum(map(len, used)) < MIN_POINTS:
        return None
    rings = _Rings.of_points(np.concatenate(used), origins_m[:1])
    if rings.contrast < ONE_ORIGIN_CONTRAST:
        aside = [points[np.abs(points[:, 1]) > ASIDE * np.abs(points[:, 0])] for points in used]
        used = aside if sum(map(len, aside)) > MIN_ASIDE * sum(map(len, used)) else used
        rings = _Rings.of_points(np.concatenate(used), origins_m)
    if rings.contrast < MIN_CONTRAST or len(rings.peaks) > MAX_BEAMS:
        return _without_beams(used)
    elevations_deg = np.rad2deg(np.arctan((rings.peaks + 0.5) * BIN - STEEPEST))
    spacing_deg = float(np.median(np.diff(elevations_deg)))
    step_deg = _azimuth_step_deg(used, rings)
    if step_deg > MAX_ASPECT * spacing_deg:
        return _without_beams(used)
    return BeamPattern(elevations_deg, spacing_deg, step_deg, rings.contrast)


@dataclass(frozen=True)
class _Rings:
    bins: Int  # (N,) bin of each point, by its best origin
    peaks: Int  # (B,) bins of the beams
    contrast: float  # share of the points above the line through the valleys between the peaks

    @classmethod
    def of_points(cls, points: Float32, origins_m: Float64) -> Self:
        """Rings of (N, 4) points whose beams may have their origin at some heights."""
        range_m = np.hypot(points[:, 0], points[:, 1])
        weight = np.minimum(range_m, np.float32(FULL_WEIGHT_M))
        best: Int = np.zeros(len(points), np.int64)
        score = np.zeros(len(points), np.float32)
        per_m = np.float32(1 / BIN) / range_m
        for origin_m in origins_m.tolist():
            bins = ((points[:, 2] - np.float32(origin_m)) * per_m + np.float32(STEEPEST / BIN)).astype(np.int64)
            np.clip(bins, 0, N_BINS - 1, out=bins)
            count = _histogram(bins, weight)
            # Mean height of the bins around, weighted by what they hold: high where peaks are sharp.
            height = _mean(count * count) / np.maximum(_mean(count), 1e-6)
            score_here = (height * (1.0 if origin_m else FRAME_ORIGIN_FAVOUR)).astype(np.float32)[bins]
            better = score_here > score
            score[better] = score_here[better]
            best[better] = bins[better]
        count = _histogram(best, weight)
        peaks = _peaks(count)
        return cls(best, peaks, _contrast(count, peaks))


def _histogram(bins: Int, weight: Float32) -> Float64:
    return gaussian(np.bincount(bins, weight, N_BINS).astype(np.float64), SMOOTH_BINS)


def _mean(count: Float64) -> Float64:
    return running_mean(running_mean(count, WINDOW_BINS), WINDOW_BINS)


def _peaks(count: Float64) -> Int:
    """(B,) bins of the beams in a histogram."""
    peaks, prominence = prominent_peaks(count)
    peaks = peaks[prominence > MIN_PROMINENCE * count[peaks]]
    if not len(peaks):
        return peaks
    mass = np.add.reduceat(count, np.append(0, (peaks[1:] + peaks[:-1]) // 2))
    kept = mass > MIN_MASS * count.sum()
    return _joined(peaks[kept], mass[kept])


def _joined(peaks: Int, mass: Float64) -> Int:
    """Peaks without those within a blurred beam, which lie far nearer to another one than the peaks around."""
    while len(peaks) > 3:
        gap = np.diff(peaks)
        around = sliding_window_view(np.pad(gap, GAPS_AROUND // 2, "symmetric"), GAPS_AROUND)
        usual = np.median(around, axis=1)
        narrowest = int(np.argmin(gap / usual))
        if gap[narrowest] >= MIN_GAP * usual[narrowest]:
            break
        lesser = narrowest + int(mass[narrowest] > mass[narrowest + 1])
        greater = 2 * narrowest + 1 - lesser
        mass[greater] += mass[lesser]
        peaks = np.delete(peaks, lesser)
        mass = np.delete(mass, lesser)
    return peaks


def _contrast(count: Float64, peaks: Int) -> float:
    """Share of a histogram above the line through the valleys between its peaks."""
    if len(peaks) < 4:
        return 0.0
    valley = np.minimum.reduceat(count, peaks)[:-1]
    inner = slice(int(peaks[0]), int(peaks[-1]))
    base = np.interp(np.arange(inner.start, inner.stop), (peaks[1:] + peaks[:-1]) / 2, valley)
    return float(1 - np.minimum(base, count[inner]).sum() / count[inner].sum())


def _azimuth_step_deg(sweeps: Sequence[Float32], rings: _Rings) -> float:
    """Most frequent step between neighbouring returns of a ring; the sweeps hold the points of the rings."""
    points = np.concatenate(sweeps)
    sweep = np.repeat(np.arange(len(sweeps)), [len(points) for points in sweeps])
    ring = sweep * len(rings.peaks) + np.searchsorted((rings.peaks[1:] + rings.peaks[:-1]) / 2, rings.bins)
    azimuth_deg = np.rad2deg(np.arctan2(points[:, 1], points[:, 0]))
    order = np.lexsort((azimuth_deg, ring))
    step = np.diff(azimuth_deg[order])[np.diff(ring[order]) == 0]
    bins = (step[(step > 0.03) & (step < 5.0)] * 100).astype(np.int64)
    if not len(bins):
        return 5.0
    mode = int(np.argmax(gaussian(np.bincount(bins).astype(np.float64), 1.0))) / 100
    near = step[np.abs(step - mode - 0.005) < 0.3 * mode + 0.01]
    return float(np.mean(near))


def _without_beams(sweeps: Sequence[Float32]) -> BeamPattern:
    """Pattern without beams: its spacing is the root of the solid angle of a firing."""
    spacings = []
    for points in sweeps:
        elevation = np.rad2deg(np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1]))) + 90
        azimuth = np.rad2deg(np.arctan2(points[:, 1], points[:, 0])) + 180
        cell = (elevation // CELL_DEG[0]).astype(np.int64) * 91 + (azimuth // CELL_DEG[1]).astype(np.int64)
        count = np.bincount(cell)
        spacings.append(np.sqrt(np.prod(CELL_DEG) / np.quantile(count[count > 0], FULL_QUANTILE)))
    spacing_deg = float(np.median(spacings))
    return BeamPattern(np.zeros(0), spacing_deg, spacing_deg)


MAX_LIKENESS_RATIO = 1.2
"""Greatest ratio of spacings at which a shipped profile counts as one of the same beams."""
SAMPLE_STEP = 20
"""Step between the points that are compared."""


def tangents(points: Float32) -> Float32:
    """(n,) tangents of the elevations of a sample of (N, 4) points; 0 for a point at the sensor itself."""
    some = points[::SAMPLE_STEP]
    range_m = np.hypot(some[:, 0], some[:, 1])
    return np.asarray(some[:, 2] / np.where(range_m > 0, range_m, np.inf), np.float32)


def spacing_ratio(a: SensorConfig, b: SensorConfig, tangent: Float32) -> float:
    """Median ratio of the spacings of two sensors' beams, the greater by the smaller, at some elevations."""
    log_ratio = np.log(a.beams.step_rad(tangent) / b.beams.step_rad(tangent))
    return float(np.exp(np.median(np.abs(log_ratio))))


def azimuth_ratio(a: SensorConfig, b: SensorConfig) -> float:
    """Ratio of the spacings along a beam, the greater by the smaller."""
    ratio = a.azimuth_step_deg / b.azimuth_step_deg
    return max(ratio, 1 / ratio)


SPEEDS = (0.5, 1.0, 2.0)
"""Speeds of a head relative to that of a profile."""
SAME_RATIO = 1.03
"""Ratio of spacings up to which profiles fit equally well."""


def azimuth_ratio_at_any_speed(a: SensorConfig, b: SensorConfig) -> float:
    """Ratio of the spacings along a beam at the speed of the head at which they are most alike."""
    return min(azimuth_ratio(replace(a, azimuth_step_deg=a.azimuth_step_deg * speed), b) for speed in SPEEDS)


def nearest_profile(found: SensorConfig, tangent: Float32) -> str | None:
    """Name of the shipped profile with the same beams; of those that fit best, the one nearest in height.

    A profile that extends another one comes after it, since a sweep cannot tell two sensors of the same beams.
    A head may turn at half or twice the speed of the profile, with other steps of azimuth.
    """
    likely = []
    for path in sorted(assets.folder("profiles").glob("*.yaml")):
        shipped = profile.resolve(path.stem)
        if shipped.sensor is None:  # the profile of a board
            continue
        sensor = shipped.config.sensor
        spacing = spacing_ratio(sensor, found, tangent)
        if max(spacing, azimuth_ratio_at_any_speed(sensor, found)) < MAX_LIKENESS_RATIO:
            away_m = abs((sensor.height_m or 0.0) - (found.height_m or 0.0))
            likely.append((spacing, (away_m, len(shipped.layers), path.stem)))
    least = min((spacing for spacing, _ in likely), default=0.0)
    alike = [order for spacing, order in likely if spacing < least * SAME_RATIO]
    return min(alike)[-1] if alike else None


MAX_SPACING_DEG = 10.0
"""Greatest spacing that a profile can state."""
EVEN_DEG = 0.05
"""Deviation from even spacing up to which beams need no table [deg]."""
EVEN_SHARE = 0.05
"""Deviation as a share of the spacing; the greater of both limits counts."""


def cell_m(spacing_deg: float, azimuth_step_deg: float) -> float:
    """Side of a cell at 10 m: the root of the mean spacing of the returns, as cells grow as the root of range."""
    return max(SegmentationConfig().cell_m, round(0.18 * float(np.sqrt(np.sqrt(spacing_deg * azimuth_step_deg))), 3))


def beam_keys(pattern: BeamPattern) -> dict[str, Any]:
    """Keys of `sensor` that describe a pattern: a table of the beams, or their step where they are evenly spaced."""
    elevations_deg = pattern.elevations_deg
    step_deg = round(pattern.azimuth_step_deg, 3)
    if not len(elevations_deg):
        step_deg = min(step_deg, MAX_SPACING_DEG)
        return {"elevation_step_deg": step_deg, "azimuth_step_deg": step_deg}
    mean_deg = float(np.ptp(elevations_deg)) / (len(elevations_deg) - 1)
    if np.abs(np.diff(elevations_deg) - mean_deg).max() < max(EVEN_DEG, EVEN_SHARE * mean_deg):
        return {"elevation_step_deg": min(round(mean_deg, 3), MAX_SPACING_DEG), "azimuth_step_deg": step_deg}
    return {"elevations_deg": tuple(np.round(elevations_deg[::-1], 2).tolist()), "azimuth_step_deg": step_deg}
