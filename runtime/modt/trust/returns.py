"""Returns by sector and beam against the usual ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from modt.trust.sample import SECTORS, Sample
from modt.trust.tuning import ReturnsTuning
from modt.types import Bool, Float64

BANDS = 12
"""Bands of elevation in the sensor's own frame, of the same width in its tangent. A level frame has returns below the
lowest beam whenever a walking robot tilts, and none whenever it is level."""
OUTER = 0.01
"""Share of the returns of the first sweep below the bands, and above them. Such returns count in the end bands."""
AROUND = 10
"""Number of sectors in which a band must usually have returns to be expected. One tree does not count."""
MIN_DEAD = 2
DEAD_SHARE = 0.08
"""Fewest bands that are dead, or their least share of all returns. One may end at an object that is out of view."""
BAND_POINTS = 24.0
"""Fewest sampled points of a band that is expected."""
MIN_POINTS = 8.0
"""Fewest sampled points of a sector, and half those of a cell in which the share of returns is judged."""
LEAST_POINTS = MIN_POINTS * BANDS
"""Fewest sampled points of a sweep by which the usual returns become known."""
THIRDS = 3
"""Parts of the bands in which the share of returns is judged."""
SIDES = ("ahead", "to the left", "behind", "to the right")


@dataclass(frozen=True)
class Loss:
    """Returns that are missing: whether too many, and a phrase for them."""

    blind: bool
    what: str


class ReturnsCheck:
    """Usual returns of each sector and band of beams. They are only followed while nothing is missing.

    Args:
        tuning: what is usual, and what counts as lost.
    """

    def __init__(self, tuning: ReturnsTuning) -> None:
        self._tuning = tuning
        self._span: tuple[float, float] | None = None  # tangents between which the bands lie
        self._usual = np.zeros((SECTORS, BANDS))
        self._counted: list[tuple[Sample, Float64]] = []  # the last counts, and of what
        self._lost: Bool = np.zeros(SECTORS, np.bool_)
        self._dead: Bool = np.zeros(BANDS, np.bool_)
        # Whether four fifths of the cells had more returns than usual, at the last look that could judge it.
        self.gained = False

    def learn(self, sample: Sample, elapsed_s: float) -> None:
        """Follow the returns of a sweep."""
        if self._span is None:
            n = sample.xyz.shape[1]
            if n < LEAST_POINTS:
                return
            tangent = np.sort(sample.tangent_in_sensor)
            self._span = float(tangent[int(OUTER * n)]), float(tangent[int((1 - OUTER) * n)]) + 1e-3
            self._usual = self._count(sample)
        gain = min(elapsed_s / self._tuning.memory_s, 1.0)
        self._usual += gain * (self._count(sample) - self._usual)

    def none_yet(self, sample: Sample) -> Loss | None:
        """The whole view, if neither this sweep nor one before had enough returns to know what is usual."""
        if self._span is not None or sample.xyz.shape[1] >= LEAST_POINTS:
            return None
        return Loss(True, "hardly any returns since the start")

    def loss(self, samples: Sequence[Sample]) -> Loss | None:
        """Missing part of the last of the sweeps since the last look; None if nothing is, or nothing is known."""
        if self._span is None:
            return None
        least = MIN_POINTS * samples[-1].weight
        count = self._count(samples[-1])
        # Each check runs in every look, since it keeps what it has found.
        sectors = self._lost_sectors(samples, least)
        bands = self._dead_bands(samples)
        everywhere = self._thinned(count, least)
        return sectors or bands or everywhere

    @property
    def n_dead(self) -> int:
        """Number of bands that are dead at the last look: their returns ended at once, and are not back."""
        return int(np.count_nonzero(self._dead))

    def _lost_sectors(self, samples: Sequence[Sample], least: float) -> Loss | None:
        """Sectors with hardly a return, of those that usually have at least some.

        A part of the view has to end at once: beside a wall that is too near, or over a crest, it ends slowly. A
        sector that ended at once counts until its returns are back. If the view is blind, all lost sectors count.
        """
        tuning = self._tuning
        usual = self._usual.sum(axis=1)
        expected = usual > np.maximum(tuning.usual_share * np.sort(usual)[SECTORS // 2], least)
        lost = expected & (self._count(samples[-1]).sum(axis=1) < tuning.lost_share * usual)
        n_expected = int(np.count_nonzero(expected))
        n_lost = int(np.count_nonzero(lost))
        blind = n_lost >= tuning.blind_share * max(n_expected, 1)
        if n_lost >= tuning.degraded_sectors:  # fewer are not reported, whether they ended at once or not
            self._lost |= self._ended(samples, usual, lost, 1)
        self._lost &= lost
        if not blind:  # a view that is lost is reported however slowly it ended
            lost = self._lost
            n_lost = int(np.count_nonzero(lost))
        if n_lost < tuning.degraded_sectors:
            return None
        where = "any direction" if n_lost >= 0.9 * n_expected else sides(lost)
        return Loss(blind, f"no returns from {where} ({360 // SECTORS * n_lost} deg)")

    def _dead_bands(self, samples: Sequence[Sample]) -> Loss | None:
        """Bands whose returns ended at once, and are gone all around. A band counts until its returns are back."""
        weight = samples[-1].weight
        usual = self._usual.sum(axis=0)
        around = (self._usual > weight).sum(axis=0) >= AROUND
        count = self._count(samples[-1]).sum(axis=0)
        dead = around & (usual > BAND_POINTS * weight) & (count < self._tuning.beam_share * usual)
        self._dead = dead & (self._dead | self._ended(samples, usual, dead, 0)) if dead.any() else dead
        n_dead = int(np.count_nonzero(self._dead))
        share = usual[self._dead].sum() / max(usual.sum(), 1.0)
        if n_dead < MIN_DEAD and share <= DEAD_SHARE:
            return None
        return Loss(n_dead * 3 >= BANDS, f"no returns from {_bands(self._dead)} beams, in any direction")

    def _ended(self, samples: Sequence[Sample], usual: Float64, missing: Bool, axis: int) -> Bool:
        """(n,) whether the returns of each sector or band ended at once, within one of the sweeps.

        The result is not limited to those that are `missing` (n,), so callers do it. It is False for all if none of
        the missing ones was whole in the first sweep.
        """
        whole = self._tuning.whole_share * usual
        if not (missing & (self._count(samples[0]).sum(axis=axis) > whole)).any():
            return np.zeros(len(usual), np.bool_)
        count = np.array([self._count(sample).sum(axis=axis) for sample in samples])
        # Two sweeps: a loss begins within one, which still has some of the returns.
        least_of_two = np.minimum(count[1:], np.concatenate([count[2:], count[-1:]]))
        return np.asarray(((count[:-1] > whole) & (least_of_two < self._tuning.lost_share * usual)).any(axis=0))

    def _thinned(self, count: Float64, least: float) -> Loss | None:
        """Returns that are missing everywhere alike. Sets `gained` if enough cells can be judged."""
        in_thirds = SECTORS, THIRDS, BANDS // THIRDS
        usual = self._usual.reshape(in_thirds).sum(axis=2)
        full = usual > 2 * least
        if np.count_nonzero(full) < SECTORS:
            return None
        ratio = np.sort(count.reshape(in_thirds).sum(axis=2)[full] / usual[full])
        self.gained = bool(ratio[len(ratio) // 5] > self._tuning.gain_ratio)
        fullest = float(ratio[-1 - len(ratio) // 5])
        if fullest >= self._tuning.thin_ratio:
            return None
        return Loss(False, f"{100 * (1 - fullest):.0f} % of the returns are missing, in all directions")

    def _count(self, sample: Sample) -> Float64:
        """(SECTORS, BANDS) returns of a sweep."""
        for known, count in self._counted:
            if known is sample:
                return count
        self._counted = [*self._counted[-1:], (sample, self._count_anew(sample))]
        return self._counted[-1][1]

    def _count_anew(self, sample: Sample) -> Float64:
        assert self._span is not None
        low, high = self._span
        steps = (sample.tangent_in_sensor - np.float32(low)) * np.float32(BANDS / (high - low))
        band = np.minimum(np.maximum(steps, 0), BANDS - 1).astype(np.int64)
        count = np.bincount(sample.sector * BANDS + band, minlength=SECTORS * BANDS)
        return np.asarray(sample.weight * count).reshape(SECTORS, BANDS)


def sides(lost: Bool) -> str:
    """Name of the side on which most of the lost sectors (SECTORS,) lie."""
    bearing = (np.flatnonzero(lost) + 0.5) * (2 * np.pi / SECTORS) - np.pi
    mean = np.arctan2(np.sin(bearing).sum(), np.cos(bearing).sum())
    return SIDES[round(float(mean) / (np.pi / 2)) % len(SIDES)]


def _bands(dead: Bool) -> str:
    which = np.flatnonzero(dead)
    if which.min() >= BANDS // 2:
        return "the upper"
    return "the lower" if which.max() < BANDS // 2 else "several"
