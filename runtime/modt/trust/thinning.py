"""Returns that thin out slowly: a lens that fogs, or a laser that fades.

Rays that look down end at the ground or at what stands on it, so their number is that of the sensor in any scene.
"""

from __future__ import annotations

import numpy as np

from modt.trust.sample import SECTORS, Sample
from modt.trust.tuning import ThinningTuning


class ThinningHistory:
    """Returns from far below, in the fullest fifth of the directions, against the most of the last minutes.

    Args:
        tuning: the memory, and what is thin.

    Attributes:
        missing_share: share of the returns that are missing; 0 if few are, or it is not known.
    """

    def __init__(self, tuning: ThinningTuning) -> None:
        self._tuning = tuning
        self._looks = 0
        self._recent = 0.0  # mean of the last looks
        self._most = 0.0  # the greatest of these means, slowly forgotten
        self.missing_share = 0.0

    def add(self, sample: Sample) -> None:
        """Add the returns of a sweep."""
        tuning = self._tuning
        count = np.bincount(sample.sector[sample.far_below], minlength=SECTORS)
        fullest = sample.weight * float(np.sort(count)[-1 - SECTORS // 5])
        self._looks += 1
        self._recent += (fullest - self._recent) / min(self._looks, tuning.mean_looks)
        if self._looks <= tuning.first_looks:
            self._most = self._recent
        elif not self.missing_share:
            self._most = max(self._recent, self._most + (self._recent - self._most) / tuning.memory_looks)
        known = self._most > tuning.least_usual * sample.weight
        missing_share = 1.0 - self._recent / self._most if known else 0.0
        self.missing_share = missing_share if missing_share > tuning.missing_share else 0.0
