"""Which rays of its grid a sensor fires in a sweep."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from modt.types import Bool, Int

COLUMN_STEP, SWEEP_STEP = (np.sqrt(5) - 1) / 2, np.sqrt(2) - 1
"""Irrational, so that no two columns or sweeps are alike."""


class ScanPattern(Protocol):
    """A choice of rays."""

    def fires(self, row: Int, column: Int, sweep: int) -> Bool:
        """(n,) whether the rays at (n,) beams and columns are fired in a sweep."""


class EveryRay:
    """The same rays in every sweep: a sensor with beams that rotate."""

    def fires(self, row: Int, column: Int, sweep: int) -> Bool:
        """(n,) all."""
        return np.ones(len(row), np.bool_)


EVERY_RAY = EveryRay()


@dataclass(frozen=True, slots=True)
class NonRepetitive:
    """Other rays in every sweep, one of `share` in each column: offsets along a low-discrepancy sequence."""

    share: int  # rays of a column for one that is fired

    def fires(self, row: Int, column: Int, sweep: int) -> Bool:
        """(n,) those whose turn it is."""
        offset = np.floor((COLUMN_STEP * column + SWEEP_STEP * sweep) % 1 * self.share)
        return np.asarray(row % self.share == offset)
