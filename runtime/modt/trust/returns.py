"""Returns by sector and beam against the usual ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from modt.trust.sample import Sample
from modt.trust.tuning import ReturnsTuning
from modt.types import Bool, Float32, Float64

SECTORS = 24
BANDS = 12
"""Bands of elevation, of the same width in its tangent."""
OUTER = 0.01
"""Share of the returns of the first sweep below the lowest band, and above the highest one."""
AROUND = 10
"""Number of sectors in which a band must usually have returns to be expected. One tree does not count."""
MIN_DEAD = 2
DEAD_SHARE = 0.08
"""Fewest bands that are dead, or their least share of all returns. One may end at an object that is out of view."""
BAND_POINTS = 24.0
"""Fewest sampled points of a band that is expected."""
MIN_POINTS = 8.0
"""Fewest sampled points of a sector, and half those of a cell in which the share of returns is judged."""
THIRDS = 3
"""Parts of the bands in which the share of returns is judged."""
SIDES = ("ahead", "to the left", "behind", "to the right")


@dataclass(frozen=True, slots=True)
class Loss:
    """Returns that are missing: whether too many, whether whole sectors are, and a phrase for them."""

    blind: bool
    sectors: bool
    what: str


class ReturnsCheck:
    """Usual returns of each sector and band of beams. They are only followed while nothing is missing.

    Args:
        tuning: what is usual, and what counts as lost.
    """

    def __init__(self, tuning: ReturnsTuning) -> None:
        self._tuning = tuning
        self._edges: Float64 | None = None  # (BANDS - 1,) tangents between the bands
        self._usual = np.zeros((SECTORS, BANDS))
        self._last: tuple[Sample, Float64] | None = None  # the last count, and of what
        self._dead: Bool = np.zeros(BANDS, np.bool_)

    def learn(self, sample: Sample, elapsed_s: float) -> None:
        """Follow the returns of a sweep."""
        if self._edges is None:
            if len(sample.counted) < MIN_POINTS * BANDS:
                return
            low, high = np.quantile(_tangents(sample), (OUTER, 1 - OUTER)).tolist()
            self._edges = np.linspace(low, high, BANDS + 1)[1:-1]
            self._usual = self._count(sample)
        gain = min(elapsed_s / self._tuning.memory_s, 1.0)
        self._usual += gain * (self._count(sample) - self._usual)

    def loss(self, samples: Sequence[Sample]) -> Loss | None:
        """What is missing in the last of the sweeps since the last look; None if nothing is, or nothing is known."""
        if self._edges is None:
            return None
        sample = samples[-1]
        least = MIN_POINTS * sample.weight
        count = self._count(sample)
        return self._lost_sectors(count, least) or self._dead_bands(count, samples) or self._thinned(count, least)

    def _lost_sectors(self, count: Float64, least: float) -> Loss | None:
        """Sectors with hardly a return, of those that usually have at least some."""
        tuning = self._tuning
        usual = self._usual.sum(axis=1)
        expected = usual > np.maximum(tuning.usual_share * np.median(usual), least)
        lost = expected & (count.sum(axis=1) < tuning.lost_share * usual)
        n_lost = int(np.count_nonzero(lost))
        if n_lost < tuning.degraded_sectors:
            return None
        n_expected = int(np.count_nonzero(expected))
        where = "any direction" if n_lost >= 0.9 * n_expected else sides(lost)
        what = f"no returns from {where} ({360 // SECTORS * n_lost} deg)"
        return Loss(n_lost >= tuning.blind_share * n_expected, True, what)

    def _dead_bands(self, count: Float64, samples: Sequence[Sample]) -> Loss | None:
        """Bands whose returns ended at once, and are gone all around."""
        weight = samples[-1].weight
        usual = self._usual.sum(axis=0)
        around = (self._usual > weight).sum(axis=0) >= AROUND
        dead = around & (usual > BAND_POINTS * weight) & (count.sum(axis=0) < self._tuning.beam_share * usual)
        self._dead = dead & (self._dead | self._ended(samples, usual)) if dead.any() else dead
        n_dead = int(np.count_nonzero(self._dead))
        share = usual[self._dead].sum() / max(usual.sum(), 1.0)
        if n_dead < MIN_DEAD and share <= DEAD_SHARE:
            return None
        return Loss(n_dead * 3 >= BANDS, False, f"no returns from {_bands(self._dead)} beams, in any direction")

    def _thinned(self, count: Float64, least: float) -> Loss | None:
        """Returns that are missing everywhere alike."""
        in_thirds = SECTORS, THIRDS, BANDS // THIRDS
        usual = self._usual.reshape(in_thirds).sum(axis=2)
        full = usual > 2 * least
        if np.count_nonzero(full) < SECTORS:
            return None
        ratio = float(np.quantile(count.reshape(in_thirds).sum(axis=2)[full] / usual[full], 0.8))
        if ratio >= self._tuning.thin_ratio:
            return None
        return Loss(False, False, f"{100 * (1 - ratio):.0f} % of the returns are missing, in all directions")

    def _ended(self, samples: Sequence[Sample], usual_of_band: Float64) -> Bool:
        """(BANDS,) whether the returns of each band ended at once, from one of the sweeps to the next."""
        count = np.array([self._count(sample).sum(axis=0) for sample in samples])
        was_whole = count[:-1] > self._tuning.whole_share * usual_of_band
        ended = count[1:] < self._tuning.beam_share * usual_of_band
        return np.asarray((was_whole & ended).any(axis=0))

    def _count(self, sample: Sample) -> Float64:
        """(SECTORS, BANDS) returns of a sweep."""
        if self._last is None or self._last[0] is not sample:
            self._last = sample, self._counted(sample)
        return self._last[1]

    def _counted(self, sample: Sample) -> Float64:
        assert self._edges is not None
        x, y, _ = sample.xyz.take(sample.counted, axis=1)
        bearing = (np.arctan2(y, x) + np.float32(np.pi)) * np.float32(SECTORS / (2 * np.pi))
        sector = bearing.astype(np.int64) % SECTORS
        band = np.searchsorted(self._edges, _tangents(sample))
        count = np.bincount(sector * BANDS + band, minlength=SECTORS * BANDS)
        return np.asarray(sample.weight * count).reshape(SECTORS, BANDS)


def _tangents(sample: Sample) -> Float64:
    """(k,) tangents of the elevations of the returns that count."""
    tangent: Float32 = sample.xyz[2] / np.maximum(sample.range_m, 1e-3)
    return tangent.take(sample.counted).astype(np.float64)


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
