"""Rays from the sensor outwards, along which the ground is followed from ring to ring.

The last bits of the lowest return of a cell hold its position in the ring, so that both are found at once.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modt.segmentation.grids import SECTORS
from modt.segmentation.tuning import GroundTuning
from modt.types import Bool, Float32

POSITIONS = 1024
"""Positions of a return in its ring that are told apart, a power of two."""
POSITION_MASK = np.int32(POSITIONS - 1)


class Slopes(NamedTuple):
    """Greatest slopes of the ground [m/m]."""

    max_slope: float  # greatest change of the slope
    ramp_slope: float  # from which ground is a ramp
    hill_slope: float  # of a hill, seen from the slope of the hill opposite
    max_rise_beside: float  # from ray to ray, at a range of 1 m [m]

    @classmethod
    def of(cls, max_slope_deg: float, tuning: GroundTuning) -> Slopes:
        """Slopes by the greatest change of the slope of the ground."""
        steepest_rad = np.deg2rad(max_slope_deg)
        steepest, ramp, hill = np.tan([steepest_rad, tuning.ramp_share * steepest_rad, 2 * steepest_rad]).tolist()
        return cls(steepest, ramp, hill, 2 * np.pi / SECTORS * steepest)


class Rays:
    """The SECTORS rays as they advance: last ground cell of each, and what was found in the rings passed.

    Args:
        slopes: greatest slopes.
        tuning: bounds on ground that continues that of a ray.
        lowest: (rings, SECTORS) lowest return of each cell [m], which is changed.
        sensor_height_m: height of the sensor above its foot.

    Attributes:
        lowest: (rings, SECTORS) height of the ground of each cell in which there is a return, if it is ground [m].
        is_ground: (rings, SECTORS) cells that are ground.
        is_ramp: (rings, SECTORS) cells on and beside a ramp, where no surface is a vehicle's side.
        stands: (rings, SECTORS) cells in which something stands.
    """

    def __init__(self, slopes: Slopes, tuning: GroundTuning, lowest: Float32, sensor_height_m: float) -> None:
        self.slopes = slopes
        self.tuning = tuning
        self.lowest = lowest
        self.is_ground: Bool = np.zeros(lowest.shape, np.bool_)
        self.is_ramp: Bool = np.zeros(lowest.shape, np.bool_)
        self.stands: Bool = np.zeros(lowest.shape, np.bool_)
        self.height_m = np.full(SECTORS, -sensor_height_m, np.float32)
        self.range_m = np.zeros(SECTORS, np.float32)
        self.slope = np.zeros(SECTORS, np.float32)  # running mean along the ray
        self.on_ramp: Bool = np.zeros(SECTORS, np.bool_)
        self.beside_ramp = self.on_ramp  # or on it

    @property
    def end_slope(self) -> Float32:
        """(SECTORS,) slope at the last ground cell of each ray that ends on a ramp, else 0."""
        return self.slope * self.on_ramp

    def advance(self, ring: int, range_m: Float32, flat: Bool, flat_behind: Bool, goes_on: Bool) -> None:
        """Find the rays that have ground in the next ring.

        Args:
            ring: that ring.
            range_m: (SECTORS,) range of the lowest returns [m].
            flat: (SECTORS,) cells in which nothing stands: the ground does not rise in the others.
            flat_behind: (SECTORS,) cells behind which nothing stands in the next ring.
            goes_on: (SECTORS,) cells behind which there are returns, none of them lower.
        """
        tuning = self.tuning
        lowest = self.lowest[ring]  # a view: writes go to self.lowest, but keep the positions, and so range_m
        # How far each return is from the line that its ray was on, extrapolated no farther than max_gap_m.
        gap = range_m - self.range_m
        residual = lowest - self.height_m - self.slope * np.minimum(gap, tuning.max_gap_m)
        # It continues its own ray. Before a ray has met any ground, a rise has to go on behind as well.
        rise_range_m = np.where(self.beside_ramp, np.float32(tuning.max_gap_m), np.float32(tuning.near_m))
        may_rise = flat & ((flat_behind & goes_on) | (self.range_m > 0))
        found: Bool = residual < np.minimum(gap, rise_range_m) * self.slopes.max_slope * may_rise + tuning.noise_m
        may_fall = residual > -(gap * self.slopes.max_slope + tuning.noise_m)
        found &= may_fall
        # Or it continues the ground of a ray beside it. Only ground that is sure itself can be continued.
        below = residual < -tuning.noise_m
        sure = found & (flat | ~below)
        may_join = flat & (residual < gap * self.slopes.hill_slope)
        # Ground that goes on behind is reached along the ring, but not from a ray that begins with a rise.
        known = sure & ((self.range_m > 0) | (residual < tuning.noise_m))
        sure |= self._reached(lowest, range_m, known, may_join & goes_on)
        beside = self._continues_beside(lowest, range_m, sure)
        found |= sure | (beside & may_join)
        # Or it is the lowest visible part of something whose foot a crest hides. Then the ground is still lower.
        stands = ~flat & may_fall
        hidden = ~beside & stands & below & (gap > tuning.near_m)
        np.copyto(lowest, _lowered(lowest, tuning.hidden_m), where=hidden)
        self._follow(lowest, range_m, found)
        self._keep(ring, found, stands)

    def _follow(self, lowest: Float32, range_m: Float32, found: Bool) -> None:
        """Move the last ground cells of the rays to those found in a ring."""
        gap = range_m - self.range_m
        # The running slope is a mean in which each stretch counts by its length.
        rise = lowest - self.height_m
        slope = self.slope + (rise - self.slope * gap) / (gap + np.float32(self.tuning.slope_length_m))
        steepest = self.slopes.hill_slope
        np.copyto(self.slope, np.minimum(np.maximum(slope, -steepest), steepest), where=found)
        np.copyto(self.height_m, lowest, where=found)
        np.copyto(self.range_m, range_m, where=found)

    def _reached(self, lowest: Float32, range_m: Float32, is_ground: Bool, may_be_reached: Bool) -> Bool:
        """(SECTORS,) ground of a ring, and the cells that it reaches along the ring, from cell to cell."""
        while True:
            more = self._continues_beside(lowest, range_m, is_ground, self.tuning.noise_m)
            more &= may_be_reached & ~is_ground
            if not more.any():
                return is_ground
            is_ground = is_ground | more

    def _continues_beside(self, lowest: Float32, range_m: Float32, is_ground: Bool, noise_m: float = 0.0) -> Bool:
        """(SECTORS,) lowest returns of a ring that continue the ground of the same ring on a ray beside theirs."""
        max_rise_m = range_m * np.float32(self.slopes.max_rise_beside) + np.float32(noise_m)
        ground = np.where(is_ground, lowest, np.float32(np.nan))
        left, right = (np.abs(lowest - np.roll(ground, step)) < max_rise_m for step in (1, -1))
        return np.asarray(left | right)

    def _keep(self, ring: int, found: Bool, stands: Bool) -> None:
        """Note the cells of a ring."""
        flank_sectors = self.tuning.flank_sectors
        self.on_ramp = np.abs(self.slope) > self.slopes.ramp_slope
        left, right = (np.roll(self.on_ramp, step) for step in (flank_sectors, -flank_sectors))
        self.beside_ramp = self.on_ramp | left | right
        self.is_ground[ring] = found
        self.is_ramp[ring] = self.beside_ramp
        self.stands[ring] = stands


def position(lowest: Float32) -> Float32:
    """(...) positions of lowest returns in their rings, from 0 to 1."""
    return (lowest.view(np.int32) & POSITION_MASK).astype(np.float32) * np.float32(1 / POSITIONS)


def _lowered(lowest: Float32, by_m: float) -> Float32:
    """(...) heights of lowest returns less `by_m`, with their positions."""
    height: Float32 = lowest - np.float32(by_m)
    bits = (height.view(np.int32) & ~POSITION_MASK) | (lowest.view(np.int32) & POSITION_MASK)
    return bits.view(np.float32)
