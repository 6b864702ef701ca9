"""Extent, size and displacement of a track, as its proposals show them."""

from __future__ import annotations

import ctypes
import math

import numpy as np

from modt.class_sizes import IS_PERSON, MAX_SIZE_M
from modt.classes import N_CLASSES, ObjectClass
from modt.geometry.kdop import DIRECTIONS
from modt.geometry.kernels import GeometryKernels
from modt.native.declarations import declare, structure
from modt.native.library import Filled
from modt.observations import Observations
from modt.tracking.track_table import TrackTable
from modt.tracking.tuning import ExtentTuning
from modt.types import Float64, Int

MAX_LENGTH_M: Float64 = np.where(np.arange(N_CLASSES) == ObjectClass.BACKGROUND, np.inf, MAX_SIZE_M[:, 0])
"""(4,) length beyond which a proposal of a track of each class is taken for several merged objects [m]."""


class ExtentUpdate:
    """Writes the columns of the extent from the proposals: the reference in NumPy.

    Args:
        tuning: weights of what is seen and what was seen before.
        agreement_m: distance beyond which an end of the mean k-DOP has jumped, as in ShapeTuning [m].
    """

    def __init__(self, tuning: ExtentTuning, agreement_m: float) -> None:
        self.tuning = tuning
        self.agreement_m = agreement_m
        self.confirmed_growth: Float64 = np.where(IS_PERSON, tuning.person_growth, tuning.growth)
        """(4,) weight of a larger box of a track whose class is confirmed."""

    def __call__(
        self,
        tracks: TrackTable,
        rows: Int,
        proposals: Int,
        observations: Observations,
        position: Float64,
        dt_s: float,
    ) -> None:
        """Write the columns of the extent.

        Args:
            tracks: written. Their hits count this frame, and new tracks have their size and lagged k-DOP already.
            rows: (R,) tracks that have a proposal.
            proposals: (R,) the proposal of each.
            observations: all proposals in the world.
            position: (R, 2) measured position of each [m, world].
            dt_s: time since the frame before [s].
        """
        kdop = observations.kdop.T.take(proposals, axis=0)
        box = observations.box.take(proposals, axis=0)
        relative = kdop - position @ DIRECTIONS
        self._envelope(tracks, rows, relative)
        self._mean(tracks, rows, relative)
        self._displacement(tracks, rows, kdop, dt_s)
        self._size(tracks, rows, box[:, 3:6])
        tracks.observed_s[rows] += dt_s
        tracks.kdop_position[rows] = position
        tracks.kdop[rows] = kdop
        tracks.box[rows] = box
        tracks.bottom[rows] = observations.bottom[proposals]
        tracks.top[rows] = observations.top[proposals]
        tracks.points[rows] = observations.count[proposals]
        tracks.proposal[rows] = proposals

    def _envelope(self, tracks: TrackTable, rows: Int, relative: Float64) -> None:
        """The known extent grows to what is seen (R, 8), relative to the position, and decays slowly towards it.

        It stays unchanged in a frame whose proposal is longer than the class of its track allows. Such a proposal is
        taken for several merged objects.
        """
        known = tracks.envelope.take(rows, axis=0)
        decay = self.tuning.known_decay
        grown = np.maximum(relative, decay * known + (1 - decay) * relative)
        longest_m = MAX_LENGTH_M[tracks.object_class[rows]]
        too_long = (relative[:, :4] + relative[:, 4:] > longest_m[:, None]).any(axis=1, keepdims=True)
        tracks.envelope[rows] = np.where(too_long, known, grown)

    def _mean(self, tracks: TrackTable, rows: Int, relative: Float64) -> None:
        """The mean k-DOP follows what is seen (R, 8), relative to the position; an end that jumps restarts."""
        off = tracks.mean_kdop.take(rows, axis=0) - relative
        weight = np.minimum(1.0 - 1.0 / tracks.hits[rows], self.tuning.mean_decay)[:, None]
        tracks.mean_kdop[rows] = relative + (np.abs(off) < self.agreement_m) * weight * off

    def _displacement(self, tracks: TrackTable, rows: Int, kdop: Float64, dt_s: float) -> None:
        """Write the displacement of the k-DOPs (R, 8) from the lagged k-DOPs, then move the lagged ones.

        Per axis the displacement is the smaller one of both ends, or 0 if they moved in opposite directions, since a
        changing view moves one end alone. The greatest over the axes counts. At a constant speed v along an axis it
        tends to v * lag_s.
        """
        lagged = tracks.lagged_kdop.take(rows, axis=0)
        shift = kdop - lagged
        ahead = shift[:, :4]
        behind = -shift[:, 4:]
        together = np.maximum(np.minimum(ahead, behind), -np.maximum(ahead, behind))
        tracks.moved_m[rows] = together.max(axis=1, initial=0.0)
        tracks.lagged_kdop[rows] = lagged + self._lag_gain(dt_s) * shift

    def _size(self, tracks: TrackTable, rows: Int, seen_m: Float64) -> None:
        """The size follows a larger box (R, 3) fast, and a smaller one slowly, since a part may be hidden."""
        size_m = tracks.size_m.take(rows, axis=0)
        change = seen_m - size_m
        confirmed = self.confirmed_growth[tracks.object_class[rows]]
        growth = np.where(tracks.final[rows], confirmed, self.tuning.growth)[:, None]
        tracks.size_m[rows] = size_m + np.where(change > 0, growth, self.tuning.shrinkage) * change

    def _lag_gain(self, dt_s: float) -> float:
        """Share of a displacement by which the lagged k-DOP moves in this time."""
        return 1.0 - math.exp(-dt_s / self.tuning.lag_s)


_COLUMNS = structure("TrackColumns")
_OBSERVATIONS = structure("Observations")


class NativeExtentUpdate(ExtentUpdate):
    """`ExtentUpdate` in C (`modt.native`)."""

    def __init__(self, library: ctypes.CDLL, tuning: ExtentTuning, agreement_m: float) -> None:
        super().__init__(tuning, agreement_m)
        declare(library, "filter.c")
        self._library = library
        self._tuning = structure("ExtentTuning").of(tuning)
        self._limits = structure("ExtentLimits").of(self, max_length_m=MAX_LENGTH_M, n_classes=N_CLASSES)
        # Filled once a table: it is the same from the births of one frame to those of the next.
        self._table: TrackTable | None = None
        self._columns: Filled | None = None

    def __call__(
        self,
        tracks: TrackTable,
        rows: Int,
        proposals: Int,
        observations: Observations,
        position: Float64,
        dt_s: float,
    ) -> None:
        """Write the columns of the extent."""
        if tracks is not self._table:
            self._columns = _COLUMNS.of(tracks)
            self._table = tracks
        self._library.modt_update_extent(
            self._columns,
            _OBSERVATIONS.of(observations, n=len(observations), dt_s=dt_s, lag_gain=self._lag_gain(dt_s)),
            rows,
            proposals,
            len(rows),
            position,
            position @ DIRECTIONS,
            self._tuning,
            self._limits,
        )


def extent_update_of(kernels: GeometryKernels, tuning: ExtentTuning = ExtentTuning()) -> ExtentUpdate:
    """The update: native if the kernels have a library, else in NumPy."""
    agreement_m = kernels.shape_tuning.agreement_m
    if kernels.library is None:
        return ExtentUpdate(tuning, agreement_m)
    return NativeExtentUpdate(kernels.library, tuning, agreement_m)
