"""The ground near the sensor: it may slope, but it does not move from one sweep to the next."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from modt.trust.sample import CELLS, RINGS, SECTORS, Sample, Three
from modt.trust.tuning import GroundTuning
from modt.types import Float32, Float64, Int

MIN_CELLS = 12
"""Fewest cells in which the ground of two sweeps is compared."""
ROUNDS = 2
"""Rounds of a fit; each leaves out the cells that are off by more than twice the median."""
NOTHING_M = 0.04
"""Median of the absolute values below which no plane is fitted to them, since they are noise [m]."""
KNOWN_M = 0.15
"""Distance from the plane within which a third of the lowest returns have to lie to be of a ground [m]."""
KNOWN_LOOKS = 5
"""Number of looks in a row in which they do. Rain and snow are no ground for long."""
LEAST_SHARE = 0.5
"""Least height of the sensor above a plane that is the ground, as a share of its height by the profile."""
MIN_STEP_M = 0.08
"""Least limit of a change of the height [m], under a sensor that is low."""
BACK_SHARE = 0.7
"""Share of the limits within which the ground is back where it was."""
KNOWN_SHARE = 0.35
"""Share of the limits within which it is the known one, as seen from another place; hills come near it by chance."""
UNSEEN_FACTOR = 2.5
"""Multiple of the limits by which the ground has moved if the sensor went on while nothing was seen."""
WITHDRAWN_S = 60.0
"""Time for which a step that was withdrawn is remembered [s]. It is withdrawn too early where the ground elsewhere
looks like the one before it."""
LEFT_SHARE = 0.35
"""Share of a step that may be left after the way back, as the ground has another shape elsewhere."""
OUT_OF_VIEW = np.array([np.inf, 0.0, 0.0])
"""Step of a ground that is no longer seen where it was."""


class GroundCheck:
    """Steps of the ground between two sweeps, and whether it is back.

    Args:
        tuning: what counts as a step.
        height_m: height of the sensor by its profile [m].

    Attributes:
        plane: (3,) the ground z = plane @ (1, x, y).
        phrase: how the ground has moved at once, in words; empty if it has not, or is back.
        undone: whether a step at the last look was the way back from one that was taken for back too early.
    """

    def __init__(self, tuning: GroundTuning, height_m: float | None) -> None:
        self._tuning = tuning
        self.plane = np.array([-(height_m or 1.0), 0.0, 0.0])
        self._profile_z_m = self.plane[0]
        self.phrase = ""
        self.undone = False
        self._offset = np.zeros(3)  # plane by which the ground is off `plane` now
        self._greatest = 0.0  # greatest size that the offset had
        self._before: Sample | None = None  # the last sweep before the ground moved; None if it has not, or is back
        self._looks = 0  # in a row in which it is back
        self._withdrawn: tuple[float, Float64] | None = None  # time and offset of one that was taken for back
        self._known_looks = 0  # in a row in which enough of the lowest returns lie on the plane

    def learn(self, sample: Sample) -> None:
        """Follow the ground of a sweep."""
        cells = np.flatnonzero(np.isfinite(sample.lowest_m))
        if len(cells) >= MIN_CELLS:
            off_m = sample.lowest_m.take(cells) - self.plane @ CELLS.take(cells, axis=1)
            self.plane = self.plane + self._tuning.gain * _fitted(cells, off_m)
            on_it = float(np.sort(np.abs(off_m))[len(cells) // 3]) < KNOWN_M
            deep_enough = self.plane[0] < LEAST_SHARE * self._profile_z_m
            self._known_looks = self._known_looks + 1 if on_it and deep_enough else 0

    @property
    def present(self) -> Float64:
        """(3,) the ground z = present @ (1, x, y) as it has moved."""
        moved = self._before is not None and bool(np.isfinite(self._offset).all())
        return self.plane + self._offset if moved else self.plane

    @property
    def known(self) -> bool:
        """Whether the lowest returns have been on the plane for some looks."""
        return self._known_looks >= KNOWN_LOOKS

    def look(self, now: Sample, threes: Sequence[Three], back_looks: int) -> None:
        """Notice a ground that moves at once, and one that is back.

        It is back where it stands as before the step or fits the known plane in enough looks, and at once if a step
        the other way has undone most of it.

        Args:
            now: the sweep that is looked at.
            threes: sweeps since the last look, each with the two that came soon after it; none if the ground has not
                moved since then.
            back_looks: number of looks in a row in which it has to be back.
        """
        self.undone = False
        if not self.known:
            return
        self._add_steps(threes)
        if self._before is None:
            return
        # By the sweep before the step, as long as the place is the same. Elsewhere by the known plane, within less.
        as_before = self._size(_moved_between(self._before, now)) < BACK_SHARE
        is_back = as_before or self._size(self._from_plane(now)) < KNOWN_SHARE
        self._looks = self._looks + 1 if is_back else 0
        undone = self._is_undone(self._offset, self._greatest)
        if self._looks >= back_looks or undone:
            self._withdrawn = None if undone else (now.time_s, self._offset)
            self.phrase = ""
            self._before = None

    def has_moved(self, before: Sample, now: Sample) -> bool:
        """Whether the ground stands elsewhere than in a sweep before, at once or not."""
        return self.known and self._size(_moved_between(before, now)) >= self._least()

    def look_past(self, before: Sample, now: Sample, *, same_place: bool) -> None:
        """Notice a ground that moved since a sweep after which nothing was seen, though slopes may have passed."""
        if not self.known or self._before is not None:
            return
        steps = (_moved_between(before, now), self._from_plane(now))
        if min(self._size(step) for step in steps) >= (1.0 if same_place else UNSEEN_FACTOR):
            self._add(_moved_between(before, now), before, now)

    def forget_step_within(self, begin_s: float, end_s: float) -> None:
        """Forget a step that began in some time. A turned scene on a slope moves the ground as well."""
        if self._before is not None and begin_s <= self._before.time_s < end_s:
            self.phrase = ""
            self._before = None

    def _from_plane(self, sample: Sample) -> Float64:
        """Plane (3,) by which most cells of a sweep are off the known ground; OUT_OF_VIEW if few have any."""
        cells = np.flatnonzero(np.isfinite(sample.lowest_m))
        if len(cells) < MIN_CELLS:
            return OUT_OF_VIEW
        return _fitted(cells, sample.lowest_m.take(cells) - self.plane @ CELLS.take(cells, axis=1))

    def _add_steps(self, threes: Sequence[Three]) -> None:
        """Add the steps of the ground within three sweeps each, the greatest first.

        A step shows in two or three groups of sweeps that follow one another, and is added once.
        """
        steps = [_moved_at_once(*three) for three in threes]
        sizes = np.array([self._size(step) for step in steps])
        while len(sizes) and sizes.max() >= self._least():
            k = int(sizes.argmax())
            self._add(steps[k], threes[k][0], threes[k][2])
            sizes[max(k - 2, 0) : k + 3] = 0.0

    def _add(self, step: Float64, before: Sample, after: Sample) -> None:
        """Add a step (3,) of the ground between two sweeps."""
        if self._before is None and self._undoes_withdrawn(step, after.time_s):
            self.undone = True
            self.plane = self.plane + step  # it was learned while the sensor was moved
            return
        if self._before is None:
            self._before = before
            self._offset = np.zeros(3)
            self._greatest = 0.0
            self._looks = 0
        self._offset = self._offset + step
        self._greatest = max(self._greatest, self._size(self._offset))
        self.phrase = self._describe()

    def _is_undone(self, left: Float64, greatest: float) -> bool:
        """Whether hardly anything is left of a step of some greatest size."""
        return self._size(left) < max(1.0, LEFT_SHARE * greatest)

    def _undoes_withdrawn(self, step: Float64, now_s: float) -> bool:
        """Whether a step is the way back from one that was taken for back too early, which is then forgotten."""
        withdrawn = self._withdrawn
        self._withdrawn = None
        if withdrawn is None or now_s - withdrawn[0] > WITHDRAWN_S:
            return False
        return self._is_undone(withdrawn[1] + step, self._size(withdrawn[1]))

    def _least(self) -> float:
        """Least size of a step. A smaller one may undo another."""
        return 1.0 if self._before is None else BACK_SHARE

    def _size(self, plane: Float64) -> float:
        """Size of a step of the ground by a plane (3,), a multiple of the limits."""
        limit_m = max(self._tuning.height_share * abs(self.plane[0]), MIN_STEP_M)
        return float(max(_tilt_deg(plane) / self._tuning.tilt_deg, abs(plane[0]) / limit_m))

    def _describe(self) -> str:
        if not np.isfinite(self._offset).all():
            return "the ground is out of view at once"
        tilt_deg = _tilt_deg(self._offset)
        if tilt_deg > self._tuning.tilt_deg:
            return f"the ground is tilted by {tilt_deg:.0f} deg against the mount"
        height_m = -self.plane[0]
        now_m = height_m - self._offset[0]
        if now_m < 0:
            return "the ground is above the sensor"
        return f"the ground is {now_m:.2f} m below the sensor, not {height_m:.2f}"


def _tilt_deg(plane: Float64) -> float:
    return float(np.rad2deg(np.arctan(np.hypot(plane[1], plane[2]))))


def _moved_between(before: Sample, after: Sample) -> Float64:
    """Plane (3,) by which most of the cells with ground in both sweeps moved.

    Where few cells have ground in both, it is OUT_OF_VIEW if many cells in view of the second one had ground in the
    first one, else zero.
    """
    ground = np.isfinite(before.lowest_m)
    both = np.flatnonzero(ground & np.isfinite(after.lowest_m))
    if len(both) >= MIN_CELLS:
        return _fitted(both, after.lowest_m.take(both) - before.lowest_m.take(both))
    expected = (ground & ~after.below_view).reshape(SECTORS, RINGS)[after.seen]
    return OUT_OF_VIEW if np.count_nonzero(expected) > 2 * MIN_CELLS else np.zeros(3)


def _moved_at_once(before: Sample, between: Sample, after: Sample) -> Float64:
    """Plane (3,) by which most of the cells moved from one of three sweeps to the next.

    What happens to a sensor begins somewhere within a sweep. Some directions of that sweep show it already,
    so each cell is taken where it moved farther. Of a slope that is driven over, about half counts.
    """
    cells = np.flatnonzero(np.isfinite(before.lowest_m) & np.isfinite(between.lowest_m) & np.isfinite(after.lowest_m))
    if len(cells) < MIN_CELLS:
        return _moved_between(before, after)
    first_m = between.lowest_m.take(cells) - before.lowest_m.take(cells)
    second_m = after.lowest_m.take(cells) - between.lowest_m.take(cells)
    return _fitted(cells, np.where(np.abs(first_m) > np.abs(second_m), first_m, second_m))


def _fitted(cells: Int, values: Float32 | Float64) -> Float64:
    """Plane (3,) through most of the values (k,) of cells (k,); zero where most values are next to nothing."""
    plane = np.zeros(3)
    off = np.abs(values)
    median = np.sort(off)[len(off) // 2]
    if median < NOTHING_M:
        return plane
    heights = values.astype(np.float64)
    places = CELLS.take(cells, axis=1)
    for _ in range(ROUNDS):
        close = places * (off <= 2 * median)
        plane = np.linalg.solve(close @ places.T + _RIDGE, close @ heights)
        off = np.abs(heights - plane @ places)
        median = np.sort(off)[len(off) // 2]
    return np.asarray(plane)


_RIDGE = 1e-6 * np.eye(3)
