"""Check that what stood still is where the pose says: obstacles of two sweeps in one log-polar grid.

A turn of the sensor shifts the grid along the bearing, a scale of the ranges along the logarithm of the range, and a
mirror reverses the bearing (Fourier-Mellin).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from modt.geometry import inverse, rotation_zyx, se3
from modt.trust.sample import SECTORS, Sample, part_of_turn, turn_of
from modt.trust.tuning import SceneTuning
from modt.types import Bool, Float32, Float64, Int

BEARINGS = 72
LOG_STEP = 0.08
"""Width of a cell in the logarithm of the range."""
OF_SECTOR = BEARINGS // SECTORS
"""Bearings of the grid in a sector of a sample."""
FIRST_RANGE_M = 1.0
"""Range at which the grid begins [m]. Nearer points are in its first cells."""
RANGES = 50
"""Cells along the range, up to 54 m."""
MIN_POINTS = 40
"""Fewest obstacle points in which a scene is compared."""
LEAST_SEEN = 0.75
"""Hits of a turn are divided by the number of obstacle points that it brings into sectors seen by the earlier sweep,
and at least by this share of all obstacle points."""
TURN_TOLERANCE = 2
"""Bearings by which a scene may be turned and count as unchanged."""
SCALE_TOLERANCE = 1
"""Steps by which a scene may be scaled and count as unchanged."""
UNSCALED_FAVOUR = 0.02
"""Share of the points by which a scale has to be better for each of its steps, as places are several steps wide."""


@dataclass(frozen=True)
class Change:
    """How the scene changed at once: turned by so many bearings, then mirrored, and scaled by so many steps."""

    mirrored: bool
    turned: int
    scaled: int

    @property
    def matrix(self) -> Float64:
        """(4, 4) the turn and the mirror."""
        T = se3(rotation_zyx(0.0, 0.0, self.turned * 2 * np.pi / BEARINGS), np.zeros(3))
        return np.diag([1.0, -1.0 if self.mirrored else 1.0, 1.0, 1.0]) @ T

    def motion(self, before: Sample, after: Sample) -> Float64:
        """(4, 4) from the sensor frame of a sweep to that of another one, both turned and mirrored like this.

        The scale is neglected.
        """
        T = inverse(after.T_world_sensor) @ before.T_world_sensor
        return T if self.is_none else self.matrix @ T @ np.linalg.inv(self.matrix)

    @property
    def is_none(self) -> bool:
        """Whether it is within the tolerances of the grid."""
        return not (self.mirrored or self.is_turned or self.is_scaled)

    @property
    def is_turned(self) -> bool:
        """Whether the scene is turned by more than the tolerance."""
        return abs(self.turned) > TURN_TOLERANCE

    @property
    def is_scaled(self) -> bool:
        """Whether the scene is scaled by more than the tolerance."""
        return abs(self.scaled) > SCALE_TOLERANCE

    def then(self, other: Change) -> Change:
        """Change that these two make, the other one after this."""
        turned = self.turned + (-other.turned if self.mirrored else other.turned)
        turned = (turned + BEARINGS // 2) % BEARINGS - BEARINGS // 2
        return Change(self.mirrored != other.mirrored, turned, self.scaled + other.scaled)

    def __str__(self) -> str:
        parts = []
        if self.mirrored:
            parts.append("mirrored")
        if self.is_turned:
            parts.append(f"turned by {self.turned * 360 // BEARINGS} deg")
        if self.is_scaled:
            parts.append(f"scaled by {np.exp(self.scaled * LOG_STEP):.2g}")
        return " and ".join(parts)


SAME = Change(False, 0, 0)


class SceneCheck:
    """Changes of the scene between two sweeps, and whether it is back.

    Args:
        tuning: what counts as another scene.

    Attributes:
        change: how the scene is changed since it was last believed.
        before: the last sweep before the change, None if there is none.
    """

    def __init__(self, tuning: SceneTuning) -> None:
        self._tuning = tuning
        self.change = SAME
        self.before: Sample | None = None
        self._agreed = 1.0  # share of the obstacle points that stood still at the last look
        self._looks = 0  # in a row in which the scene is back
        # Sweeps of the last looks since the change. A robot moves farther between them than between two looks.
        self._recent: deque[Sample] = deque(maxlen=tuning.motion_looks)
        self._compared: tuple[Sample, Sample, float] | None = None  # two sweeps, and the share that stood still

    def look(
        self,
        first: Sample,
        now: Sample,
        pairs: Sequence[tuple[Sample, Sample]],
        back_looks: int,
        *,
        unsure: bool = False,
    ) -> None:
        """Notice a scene that changes at once, and one that is back.

        Args:
            first: the sweep of the last look, or the last one before nothing was seen.
            now: the sweep that is looked at.
            pairs: sweeps since then between which it may have changed; mostly those with one sweep between them.
            back_looks: number of looks in a row in which it has to be back.
            unsure: whether the ground has moved, or the way between the sweeps is not known. A change has to explain
                nearly all obstacles then, and a scale is left to the ground's check.
        """
        tuning = self._tuning
        suspected = self.may_have_changed(first, now)
        self._agreed = self._agreement(first, now)
        if suspected or not self.change.is_none:
            self._notice(pairs, unsure=unsure)
        if self.before is None:
            return
        self._recent.append(now)
        is_back = agreement(self.before, now, SAME) >= tuning.back or self._moves_as_before(first, now)
        is_back = is_back or any(self._moves_as_before_since(earlier, now) for earlier in self._recent)
        self._looks = self._looks + 1 if is_back else 0
        if self._looks >= back_looks or self.change.is_none:
            self.change = SAME
            self.before = None

    def may_have_changed(self, first: Sample, now: Sample) -> bool:
        """Whether few obstacle points stood still, or clearly fewer than at the last look."""
        agreed = self._agreement(first, now)
        return agreed < self._tuning.same or self._falls_to(agreed)

    def _agreement(self, first: Sample, now: Sample) -> float:
        """Share of the obstacle points that stood still between two sweeps, which are compared once."""
        if self._compared is None or self._compared[0] is not first or self._compared[1] is not now:
            self._compared = first, now, agreement(first, now, self._known_change(now))
        return self._compared[2]

    def _pair_agreement(self, before: Sample, after: Sample) -> float:
        """Greatest share of the obstacle points that stood still between two sweeps by a pose of the second one."""
        return max(agreement(before, placed, self._known_change(after)) for placed in _as_placed(before, after))

    def _known_change(self, now: Sample) -> Change:
        """Change by which sweeps are compared. A pose that is registered by sweeps is one of the changed sensor."""
        return self.change if now.pose_given else SAME

    def _falls_to(self, agreed: float) -> bool:
        return agreed < self._tuning.suspected and agreed < self._agreed - self._tuning.fall

    def _moves_as_before(self, first: Sample, now: Sample) -> bool:
        """Whether obstacles move by a given pose as in a scene that is not changed, and not as in the changed one."""
        if not (first.pose_given and now.pose_given):
            return False
        return agreement(first, now, SAME) > agreement(first, now, self.change) + self._tuning.better

    def _moves_as_before_since(self, earlier: Sample, now: Sample) -> bool:
        """Whether most obstacles moved so over a longer way. Along it, a mirrored street is much like a street."""
        stands = not self.change.mirrored and agreement(earlier, now, SAME) >= self._tuning.same
        return stands and self._moves_as_before(earlier, now)

    def _notice(self, pairs: Sequence[tuple[Sample, Sample]], *, unsure: bool) -> None:
        """Note how the scene changed within one of the pairs, if it did.

        What begins within a sweep falls into two pairs that follow one another, and only the pair around that sweep
        shows all of it. Both may agree equally little, so the one to which an explanation adds most is taken.
        """
        agreed = np.array([self._pair_agreement(before, after) for before, after in pairs])
        if not len(agreed) or agreed.min() >= self._tuning.suspected:
            return
        least = int(agreed.argmin())
        found = []
        for k in range(max(least - 1, 0), min(least + 2, len(pairs))):
            for after in _as_placed(*pairs[k]):
                change, share = explain(pairs[k][0], after, self._known_change(after))
                found.append((share - float(agreed[k]), k, change))
        gain, k, change = max(found, key=lambda each: each[0])
        if self._is_explained(change, float(agreed[k]), gain, unsure=unsure):
            if self.before is None:
                self.before = pairs[k][0]
                self._looks = 0
            self._recent.clear()
            self.change = self.change.then(change)

    def _is_explained(self, change: Change, agreed: float, gain: float, *, unsure: bool) -> bool:
        """Whether a change explains two sweeps, of which a share agrees without it, and more by a gain with it."""
        tuning = self._tuning
        if change.is_none or (unsure and change.is_scaled):
            return False
        other_scene = agreed < tuning.same and not unsure
        needed = tuning.explained if other_scene else tuning.surely_explained
        if self.change.then(change).is_none:  # the way back
            needed = 0.0
        return gain >= max(needed - agreed, tuning.better)


def _as_placed(before: Sample, after: Sample) -> Iterator[Sample]:
    """The second of two sweeps by its pose and, unless that is given, as if the motion before had gone on.

    Registration takes a scene that changes at once for a motion, if it finds any.
    """
    yield after
    if not after.pose_given:
        yield replace(after, T_world_sensor=before.T_world_sensor @ before.step @ before.step)


def _cells(x: Float32, y: Float32, turn: Float32) -> Int:
    """(k,) cells of points at x and y [m] and their bearings [turns], below 0 beyond the grid."""
    bearing = part_of_turn(turn, BEARINGS)
    far = (np.log(np.maximum(x * x + y * y, FIRST_RANGE_M**2)) * np.float32(0.5 / LOG_STEP)).astype(np.int64)
    return np.where(far < RANGES, bearing * RANGES + far, -1)


def places(before: Sample, after: Sample, change: Change) -> tuple[Int, Int]:
    """Cells of the obstacle points of two sweeps in the frame of the second one."""
    a = change.motion(before, after).astype(np.float32)
    x, y = a[:2, :3] @ before.xyz.take(before.obstacles, axis=1) + a[:2, 3:]
    known = _cells(x, y, turn_of(x, y))
    x, y, _ = after.xyz.take(after.obstacles, axis=1)
    cells = _cells(x, y, after.turn.take(after.obstacles))
    return known[known >= 0], cells[cells >= 0]


def _in(cells: Int, seen: Bool) -> Int:
    """The cells of the grid that are in seen sectors (SECTORS,)."""
    return np.asarray(cells[seen.take(cells // (RANGES * OF_SECTOR))])


def _grown(cells: Int) -> Bool:
    """(BEARINGS, RANGES) occupied cells, and those beside them."""
    grid = np.zeros((BEARINGS + 2, RANGES), np.bool_)
    grid[1:-1].reshape(-1)[cells] = True
    grid[0] = grid[-2]
    grid[-1] = grid[1]
    wide: Bool = grid[1:-1] | grid[:-2] | grid[2:]
    grown = wide.copy()
    grown[:, 1:] |= wide[:, :-1]
    grown[:, :-1] |= wide[:, 1:]
    return grown


def agreement(before: Sample, after: Sample, change: Change) -> float:
    """Share of the obstacle points of a sweep that stand where the one before had some; 1 with too few."""
    known, cells = places(before, after, change)
    known = _in(known, after.seen)
    cells = _in(cells, before.seen)
    if min(len(known), len(cells)) < MIN_POINTS:
        return 1.0
    return float(_grown(known).ravel().take(cells).mean())


def explain(before: Sample, after: Sample, known_change: Change) -> tuple[Change, float]:
    """The further change that explains a sweep best, and the greatest share of its points at known places.

    The change is chosen with a preference for small scales (UNSCALED_FAVOUR). The share is the greatest that any
    shift reaches, so it may be a little greater than that of the chosen one.
    """
    known, cells = places(before, after, known_change)
    n = RANGES + 20  # room along the range, which does not close as the bearing does
    wide = np.zeros((BEARINGS, n))
    wide[:, :RANGES] = _grown(known)
    spectrum = np.conj(np.fft.rfft2(wide))
    seen = np.conj(np.fft.rfft(before.seen.repeat(OF_SECTOR)))
    found = []
    for mirrored in (False, True):
        bearing, far = np.divmod(cells, RANGES)
        if mirrored:
            bearing = BEARINGS - 1 - bearing
        now = np.bincount(bearing * n + far, minlength=BEARINGS * n).reshape(BEARINGS, n).astype(np.float64)
        # Points on known places for every turn and scale at once: the cross-correlation of both grids. Of the points
        # only those count that the sweep before could have seen there: one in which a head turns is broken.
        could = np.fft.irfft(seen * np.fft.rfft(now.sum(axis=1)), BEARINGS)
        hits = np.fft.irfft2(spectrum * np.fft.rfft2(now), s=wide.shape)
        hits /= np.maximum(could, max(LEAST_SEEN * len(cells), 1))[:, None]
        scales = np.arange(n)
        scales[n // 2 :] -= n
        turned, column = np.divmod(int((hits - UNSCALED_FAVOUR * np.abs(scales)).argmax()), n)
        turned = (int(turned) + BEARINGS // 2) % BEARINGS - BEARINGS // 2
        found.append((Change(mirrored, turned, int(scales[column])), float(hits.max())))
    return max(found, key=lambda each: each[1])
