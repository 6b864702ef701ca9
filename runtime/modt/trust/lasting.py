"""Lasting losses too small to be told from one sweep: single beams, and narrow sectors of the view."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from modt.config import SensorConfig
from modt.trust.sample import NEAREST_M, SECTORS, Sample, part_of_turn, turn_of
from modt.trust.tuning import LastingTuning
from modt.types import Bool, Float32, Float64, Int

BEARINGS = 72
"""Parts of a turn in which a blocked sector is looked for."""
ON_BEAM = 0.25
"""Distance from a beam within which a return is on it [beam spacings]; without beams half of them are."""
BESIDE = 3
"""Parts of a turn beside a sector in which a wall would go on."""
LEVEL_SHARE = 0.3
"""Share of its range that a return of a wall is below the sensor at most; lower ones are of the ground."""
EDGE = 2
"""Parts of a turn beside a covered sector that are whole. The ground before a drop ends less sharply."""


class BeamHistory:
    """Returns of each beam over a window of time.

    A beam is dead if it has none where the beams above and below it have many. The outermost beams have a neighbour
    on one side only, so nothing tells that they should have met anything. Where the profile lists the elevations,
    a beam must have had returns before: a list that was measured in a sweep may have one too many.

    Args:
        sensor: elevations of its beams.
        tuning: the window, and what is dead.
    """

    def __init__(self, sensor: SensorConfig, tuning: LastingTuning) -> None:
        self._tuning = tuning
        self._elevation_deg = np.asarray(sensor.beam_elevations_deg)
        self._tangent = np.tan(np.deg2rad(self._elevation_deg))
        self._count = np.zeros((len(self._tangent), SECTORS))
        self._exists: Bool = np.full(len(self._tangent), sensor.elevations_deg is None)
        self._n_on_beam = 0
        self._n_seen = 0
        self._began_s: float | None = None
        self.dead_deg: tuple[float, ...] = ()  # elevations of the dead beams, descending

    def add(self, sample: Sample) -> None:
        """Add the returns of a sweep."""
        if len(self._tangent) < 3:
            return
        if self._began_s is None:
            self._began_s = sample.time_s
        tangent = sample.tangent_in_sensor
        place = np.interp(tangent, self._tangent, np.arange(len(self._tangent)))
        beam = np.rint(place).astype(np.int64)
        self._n_on_beam += int(np.count_nonzero(np.abs(place - beam) < ON_BEAM))
        self._n_seen += len(beam)
        flat = np.bincount(beam * SECTORS + sample.sector, minlength=self._count.size)
        self._count += flat.reshape(self._count.shape)
        if sample.time_s - self._began_s >= self._tuning.window_s:
            self._judge()
            self._began_s = sample.time_s
            self._count[:] = 0
            self._n_on_beam = 0
            self._n_seen = 0

    def _judge(self) -> None:
        """Set the dead beams by the returns of the window."""
        if self._n_on_beam < self._tuning.on_beam_share * self._n_seen:
            self.dead_deg = ()  # no beams, or others than those of the profile
            return
        total = self._count.sum(axis=1)
        alive = np.flatnonzero(total)
        self._exists[alive] = True
        dead = [b for b in np.flatnonzero(self._exists).tolist() if self._is_dead(b, total[b], alive)]
        self.dead_deg = tuple(self._elevation_deg[dead[::-1]].tolist())

    def _is_dead(self, beam: int, n_returns: float, alive: Int) -> bool:
        below = alive[alive < beam]
        above = alive[alive > beam]
        if not len(below) or not len(above):
            return False
        expected = np.minimum(self._count[below[-1]], self._count[above[0]])
        enough = expected.sum() >= self._tuning.min_returns
        around = np.count_nonzero(expected) >= self._tuning.min_sectors
        return bool(enough and around and n_returns < self._tuning.dead_share * expected.sum())


class SectorHistory:
    """Narrow sectors in which there are no returns at all.

    A view that is blocked ends from one look to the next, or slowly where it had met the ground. Then its edges are
    sharp, as those of a drop, of water or of a crest seldom are.

    A wall closer than the minimum range also leaves a dark sector, but its farther parts return beside it, so such a
    sector is not blocked. Sensors with a long minimum range are not judged by lost returns, since anything may stand
    within it. A sector that never had a return is blocked as well, unless the profile knows of it.

    Args:
        sensor: its blind sectors.
        tuning: what is blocked.
    """

    def __init__(self, sensor: SensorConfig, tuning: LastingTuning) -> None:
        self._tuning = tuning
        self._began_s: float | None = None
        self._sees_near = sensor.min_range_m < tuning.nearest_m
        self._near_m = tuning.near_share * max(sensor.min_range_m, NEAREST_M)
        self._looks = 0
        self._usual: Float64 = np.zeros((2, BEARINGS))  # returns of a look: all, and those far below the sensor
        self._last: Float64 = np.zeros(BEARINGS)  # all returns of the last look
        self._ever: Bool = _within(sensor.blind_sectors_deg or ())  # had returns, or is known to be blind
        self._empty_since_s: Float64 = np.full(BEARINGS, np.inf)  # infinite where no ground was met before
        self._dark_since_s: Float64 = np.full(BEARINGS, np.inf)  # infinite where the view has not ended
        self.blocked_deg: tuple[int, int] | None = None  # bearings from and to, counter-clockwise

    def add(self, sample: Sample) -> None:
        """Look at the returns of a sweep."""
        tuning = self._tuning
        now_s = sample.time_s
        count = _counted(sample)
        if self._began_s is None:
            self._began_s = now_s
        self._ever |= count[0] > 0
        expected = self._usual >= tuning.least_usual * sample.weight
        empty = expected & (count[0] == 0) & self._sees_near
        self._empty_since_s = np.where(empty[1], np.minimum(self._empty_since_s, now_s), np.inf)
        ended = empty[0] & (self._last >= tuning.whole_share * self._usual[0])
        covered = self._covered(count[1], sample)
        known = np.isfinite(self._dark_since_s)
        dark = (ended | covered | known) & (count[0] <= tuning.lit_share * self._usual[0])
        since_s = np.where(covered, self._empty_since_s, now_s)
        self._dark_since_s = np.where(dark, np.minimum(self._dark_since_s, since_s), np.inf)
        self._looks += 1
        gain = max(tuning.gain, 1 / self._looks)
        self._usual = np.where(dark | empty[1], self._usual, self._usual + gain * (count - self._usual))
        self._last = count[0]
        blocked = self._dark_since_s <= now_s - tuning.dark_s
        if now_s - self._began_s >= tuning.window_s and not self._ever.all():
            blocked |= self._never_lit()
        self.blocked_deg = self._blocked(blocked, sample.raw) if blocked.any() else None

    def _never_lit(self) -> Bool:
        """(BEARINGS,) parts that never had a return, unless they are the sensor's design."""
        never = ~self._ever
        by_design = _longest_run(never)[1] > self._tuning.most_bearings
        return never & (not by_design)

    def _covered(self, n_down: Float64, sample: Sample) -> Bool:
        """(BEARINGS,) parts of the widest sector that ended, however slowly, if a cover explains it.

        Args:
            n_down: (BEARINGS,) returns of this look from far below the sensor.
            sample: the sweep.
        """
        tuning = self._tuning
        empty = np.isfinite(self._empty_since_s)
        covered = np.zeros(BEARINGS, np.bool_)
        first, n = _longest_run(empty)
        run = (first + np.arange(n)) % BEARINGS
        lasting = self._empty_since_s[run] <= sample.time_s - tuning.dark_s
        if np.count_nonzero(lasting) < tuning.least_bearings:
            return covered
        beside = np.stack([first - 1 - np.arange(EDGE), (first + n + np.arange(EDGE)) % BEARINGS])
        usual = np.maximum(self._usual[1, beside], tuning.least_usual * sample.weight)
        sharp = n_down[beside].sum(axis=1) >= tuning.edge_share * usual.sum(axis=1)
        covered[run] = sharp.all() and not self._has_near(sample.raw, first, n)
        return covered

    def _blocked(self, blocked: Bool, raw: Float32) -> tuple[int, int] | None:
        """The widest sector of blocked parts of a turn (BEARINGS,), unless it is narrow or a wall hides it."""
        first, n = _longest_run(blocked)
        if n < self._tuning.least_bearings or self._has_near(raw, first, n):
            return None
        step_deg = 360 // BEARINGS
        first_deg = first * step_deg - 180
        return first_deg, first_deg + n * step_deg

    def _has_near(self, raw: Float32, first: int, n: int) -> bool:
        """Whether returns (k, 3) in n parts of a turn, or beside them, are as near as a wall that hides the view."""
        x, y, z = raw.T[:3]
        range_m = np.sqrt(x * x + y * y)
        near = (range_m > 0) & (range_m < self._near_m) & (z > -LEVEL_SHARE * range_m)
        bearing = part_of_turn(turn_of(x[near], y[near]), BEARINGS)
        return bool(((bearing - first + BESIDE) % BEARINGS < n + 2 * BESIDE).any())


def _counted(sample: Sample) -> Float64:
    """(2, BEARINGS) returns of a sweep in each part of a turn: all, and those far below the sensor."""
    part = part_of_turn(sample.turn, BEARINGS)
    down = part[sample.far_below]
    counts = [np.bincount(each, minlength=BEARINGS) for each in (part, down)]
    return np.asarray(sample.weight * np.array(counts))


def _within(sectors_deg: Sequence[float]) -> Bool:
    """(BEARINGS,) parts of a turn that are in sectors, each from and to, counter-clockwise."""
    middle_deg = (np.arange(BEARINGS) + 0.5) * (360 / BEARINGS) - 180
    within = np.zeros(BEARINGS, np.bool_)
    for first_deg, last_deg in zip(sectors_deg[::2], sectors_deg[1::2], strict=True):
        within |= (middle_deg - first_deg) % 360 <= (last_deg - first_deg) % 360
    return within


def _longest_run(parts: Bool) -> tuple[int, int]:
    """First of the parts (n,) of a turn in the longest run that is True, and the length of the run."""
    gaps = np.flatnonzero(~parts)
    if not len(gaps):
        return 0, len(parts)
    length = np.diff(gaps, append=gaps[0] + len(parts)) - 1
    longest = int(length.argmax())
    return int(gaps[longest] + 1) % len(parts), int(length[longest])
