"""The ceiling of a room: nothing of it becomes a proposal, and it joins no objects."""

from __future__ import annotations

import numpy as np

from modt.segmentation.tuning import CeilingTuning
from modt.types import Float32, Int


class CeilingFinder:
    """Height up to which objects reach under a ceiling, by the heights of the returns above people's heads.

    Args:
        max_height_m: greatest height above ground at which returns are used.
        tuning: bounds on the heights and the number of returns of a ceiling.
    """

    def __init__(self, max_height_m: float, tuning: CeilingTuning = CeilingTuning()) -> None:
        self.max_height_m = max_height_m
        self.tuning = tuning
        self.bins = max(0, int((max_height_m - tuning.above_m) / tuning.bin_m)) + 2

    def histogram(self, height: Float32) -> Int:
        """(bins,) returns in each bin of height from `above_m` on, by (K,) heights of returns above ground [m]."""
        above = np.float32(self.tuning.above_m)
        upper = height[height > above]
        bin_ = ((upper - above) / np.float32(self.tuning.bin_m)).astype(np.int64)
        return np.bincount(bin_, minlength=self.bins)

    def limit_m(self, histogram: Int, z: Float32, sensor_height_m: float) -> float | None:
        """Greatest height of objects above ground [m], None without a ceiling.

        Args:
            histogram: (bins,) returns used, by height.
            z: (N,) coordinates of all returns [m, sensor frame], with those too high to be used.
            sensor_height_m: height of the sensor above ground.
        """
        limit_m = self.within_m(histogram)
        if limit_m is None:
            limit_m = self.grazing_m(z[:: self.tuning.stride], sensor_height_m)
        return limit_m

    def within_m(self, histogram: Int) -> float | None:
        """Limit under a ceiling that lies wholly within the heights used; None without one.

        Most of the returns above people's heads are at one height there; on walls, trees and houses they spread.
        """
        tuning = self.tuning
        counted = int(histogram.sum())
        if counted < tuning.min_returns:
            return None
        in_two_bins = histogram[:-1] + histogram[1:]
        in_two_bins[: round((tuning.lowest_m - tuning.above_m) / tuning.bin_m)] = 0
        first = int(in_two_bins.argmax())
        if in_two_bins[first] < tuning.min_share * counted:
            return None
        if first and histogram[first - 1] > tuning.edge_share * in_two_bins[first]:
            first -= 1
        return tuning.above_m + tuning.bin_m * first - tuning.clearance_m

    def grazing_m(self, z: Float32, sensor_height_m: float) -> float | None:
        """Limit under a ceiling at about `max_height_m`, so only its lower returns are used; None without one."""
        tuning = self.tuning
        z = np.ascontiguousarray(z)
        upper = z.compress(z > np.float32(tuning.above_m - sensor_height_m)) + np.float32(sensor_height_m)
        on_ceiling = upper > self.max_height_m - tuning.grazed_below_m
        on_ceiling &= upper < self.max_height_m + tuning.grazed_above_m
        if tuning.stride * len(upper) < tuning.min_returns:
            return None
        if np.count_nonzero(on_ceiling) < tuning.min_share * len(upper):
            return None
        return self.max_height_m - tuning.grazed_clearance_m
