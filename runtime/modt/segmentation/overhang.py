"""What hangs above people: crowns of trees, awnings, lintels.

A grid seen from above joins a person and what hangs above into one cell. The gap between them is told by the levels
of height at which the cells around have points.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modt.segmentation.grids import Int32
from modt.segmentation.tuning import OverhangTuning
from modt.types import NONE, Float32, Int

LEVELS_PER_M = 10
"""Levels of height in a metre."""
N_LEVELS = 31
"""Number of levels, a bit each. The highest holds all points above."""
BLOCK_CELLS = 3
"""Side of a block of cells that shows a gap. In single cells, few returns of a van leave gaps by chance."""


class Overhangs(NamedTuple):
    """Points of C cells that belong to another cluster than the rest of their cell, which is a person."""

    below_m: Float32  # (C,) height above which the points hang [m], infinite where none do
    cluster: Int  # (C,) cluster of these points, NONE where there are none

    @classmethod
    def above(cls, cells: Int, top_m: Float32, cluster: Int) -> Overhangs:
        """What hangs above (C,) top_m in some cells, in the (C,) cluster of its cell."""
        hanging = cls(np.full(len(cluster), np.inf, np.float32), np.full(len(cluster), NONE))
        hanging.below_m[cells] = top_m[cells]
        hanging.cluster[cells] = cluster[cells]
        return hanging


def levels_of(height: Float32) -> Int32:
    """(n,) the bit of the level of each height above ground [m]."""
    level = np.minimum(np.maximum(height * np.float32(LEVELS_PER_M), 0), N_LEVELS - 1).astype(np.int32)
    bit: Int32 = np.left_shift(np.int32(1), level)
    return bit


def standing_top_m(
    row: Int32, column: Int32, levels: Int32, high: Float32, beam_m: Float32, tuning: OverhangTuning
) -> Float32:
    """(C,) height up to which the points of each cell stand [m]: below the lowest gap, or the top of the cell.

    A gap is a run of levels at which no cell of the block has a point, with points above. It is looked for from the
    height of a child on. The height is 0 where all points of a cell are above the gap of its block.

    Args:
        row: (C,) of the grid.
        column: (C,) of the grid.
        levels: (C,) levels of height with a point.
        high: (C,) greatest height of the points above ground [m].
        beam_m: (C,) vertical distance of neighbouring beams [m].
        tuning: gaps.
    """
    around = _of_blocks(row, column, levels)
    gap_m = np.maximum(np.float32(tuning.gap_m), np.float32(tuning.gap_beams) * beam_m)
    n_empty = np.minimum(np.ceil(gap_m * np.float32(LEVELS_PER_M)), N_LEVELS).astype(np.int64)
    first = np.full(len(row), N_LEVELS)
    for level in range(tuning.last_level, tuning.first_level - 1, -1):
        is_empty = (around >> level) & ((1 << n_empty) - 1) == 0
        first[is_empty & (around >> (level + n_empty) > 0)] = level
    standing = levels & ((1 << first) - 1)
    _, n_bits = np.frexp(standing.astype(np.float64))
    top_m = n_bits.astype(np.float32) * np.float32(1 / LEVELS_PER_M)
    return np.where(first < N_LEVELS, top_m, high)


def _of_blocks(row: Int32, column: Int32, levels: Int32) -> Int:
    """(C,) levels of the block of cells in which each lies."""
    block = ((row // BLOCK_CELLS).astype(np.int64) << 32) + column // BLOCK_CELLS
    _, number = np.unique(block, return_inverse=True)
    of_block = np.zeros(int(number.max(initial=NONE)) + 1, np.int64)
    np.bitwise_or.at(of_block, number, levels)
    return of_block[number]
