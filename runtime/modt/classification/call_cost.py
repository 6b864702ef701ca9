"""CPU time of classifications, as measured on this machine: the price that the scheduler expects of its calls."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from itertools import product

import numpy as np

from modt.classification.crops import batches
from modt.classification.tuning import BatchingTuning, CallCostTuning
from modt.config import ClassificationConfig
from modt.types import Float32, Float64, Int, Proposals


def padded_size(limits: ClassificationConfig, tuning: BatchingTuning = BatchingTuning()) -> Callable[[Int], int]:
    """Function that counts the points processed by the network, padding included, for proposals of (R,) points.

    A call takes a batch of proposals, of max_points each at most, padded to the largest of them and to min_points.
    """
    return partial(_padded_size, limits, tuning)


def _padded_size(limits: ClassificationConfig, tuning: BatchingTuning, count: Int) -> int:
    most = limits.max_points
    least = limits.min_points
    size = sorted(max(min(n, most), least) for n in count.tolist())  # of so few, lists are faster than arrays
    sliced = batches(size, limits.batch, tuning.max_padding_points)
    return sum((rows.stop - rows.start) * size[rows.stop - 1] for rows in sliced)


_POINTS = 100.0
"""Unit of the points in the fit, which conditions it."""
_DIAGONAL = np.eye(3)
_MIN_MEASURED_MS = 1e-3
"""A shorter CPU time means that nothing was measured [ms]."""


class LinearCost:
    """CPU time of the classifications of a frame, linear in their number and points.

    The fit is by least squares with forgetting, of errors relative to the time measured, so that a spike hardly
    counts. A margin over the fit grows by a step with each underestimate and shrinks slowly otherwise, which keeps
    underestimates rare. Without measurements the margin shrinks on, and earlier measurements count less once there is
    a new one.

    Args:
        max_points: limit of the points of a proposal handed to the network.
        size: function that counts the points processed by the network for proposals of (R,) points.
        tuning: memory and margins of the fit.

    Attributes:
        size: as given.
    """

    def __init__(
        self, max_points: int, size: Callable[[Int], int], tuning: CallCostTuning = CallCostTuning()
    ) -> None:
        self.size = size
        self._max_points = max_points
        self._tuning = tuning
        self._margin = tuning.start_margin
        self._starved = 0
        # Normal equations of `terms / cpu_ms @ x = 1`: the matrix (3, 3), and beside it the right-hand side.
        self._equations = np.zeros((3, 4))
        self._fitted_ms: Float64 | None = None

    @property
    def outdated(self) -> bool:
        """True after so many starved frames since the last call that a measurement is worth exceeding the budget."""
        return self._starved >= self._tuning.starved_frames

    def cost_ms(self, points: Int) -> float:
        """Upper estimate of the CPU time of classifying proposals of (R,) points together [ms]."""
        return float(self._terms(points) @ self._terms_ms())

    @property
    def fixed_ms(self) -> float:
        """Upper estimate of the CPU time that a frame's calls take together, whatever their number [ms]."""
        return float(self._terms_ms()[0])

    def added_ms(self, points: Int) -> Float64:
        """(R,) least CPU time that each proposal of (R,) points adds to the frame's, without padding [ms]."""
        _, call_ms, points_ms = self._terms_ms()
        added: Float64 = call_ms + points_ms / _POINTS * np.minimum(points, self._max_points)
        return added

    def warmed_up(self, points: Int, cpu_ms: float) -> None:
        """Add the CPU time that classifying proposals of (R,) points together took before the first frame."""
        if cpu_ms >= _MIN_MEASURED_MS:
            self._learn(self._terms(points), cpu_ms, self._tuning.warm_up_weight)

    def update(self, points: Int, cpu_ms: float) -> None:
        """Add the measured CPU time of classifying proposals of (R,) points together."""
        if len(points) and _MIN_MEASURED_MS <= cpu_ms < math.inf:
            terms = self._terms(points)
            self._adapt_margin(underestimated=cpu_ms > float(terms @ self._terms_ms()))
            self._equations *= self._tuning.memory ** (1 + self._starved)
            self._learn(terms, cpu_ms, 1.0)
            self._starved = 0

    def record_starved_frame(self) -> None:
        """Add a frame whose whole budget is below the estimate of its first call."""
        self._adapt_margin(underestimated=False)
        self._starved += 1

    def _adapt_margin(self, underestimated: bool) -> None:
        step = self._tuning.margin_step * (underestimated - self._tuning.accepted_underestimates)
        self._margin = max(1.0, self._margin * math.exp(step))

    def _learn(self, terms: Float64, cpu_ms: float, weight: float) -> None:
        """Add a measurement of the terms (3,) to the normal equations."""
        row = np.ones(4)
        row[:3] = terms / cpu_ms
        self._equations += weight * row[:3, None] * row
        self._fitted_ms = None

    def _terms(self, points: Int) -> Float64:
        """(3,) terms of the cost: the frame itself, calls, and points in units of _POINTS."""
        return np.array([1.0, len(points), self.size(points) / _POINTS])

    def _terms_ms(self) -> Float64:
        """(3,) upper estimate of each term's CPU time [ms]."""
        if self._fitted_ms is None:
            normal = self._equations[:, :3]
            little = _DIAGONAL * (1e-9 + 1e-6 * normal.trace())  # solvable also with few measurements
            self._fitted_ms = np.maximum(np.linalg.solve(normal + little, self._equations[:, 3]), 0.0)
        return self._margin * self._fitted_ms


_ROUNDS = 5
"""Measurements of a frame of the warm-up, whose median counts."""
_FEW_POINTS = 8
"""Points of a small proposal of the warm-up."""
_CACHE_BYTES = 4 << 20
"""Bytes written before each call of the warm-up: between two frames other stages fill the caches."""


Classify = Callable[[Float32, Proposals, Int], Float64]
"""Likelihoods (R, C) of the proposals of a frame that are named by index."""


def warm_up(classify: Classify, cost: LinearCost, max_points: int, batch: int, cpu_ns: Callable[[], int]) -> None:
    """Classify small and large frames, so that no frame pays for what a first call sets up; the cost model learns."""
    for n, points in product((1, batch, 2 * batch), (min(_FEW_POINTS, max_points), max_points)):
        cloud, proposals = _columns(n, points)
        times_ms = []
        for _ in range(_ROUNDS):
            np.ones(_CACHE_BYTES, np.uint8)
            start_ns = cpu_ns()
            classify(cloud, proposals, np.arange(n))
            times_ms.append((cpu_ns() - start_ns) / 1e6)
        cost.warmed_up(proposals.count, float(np.median(times_ms)))


def _columns(n: int, points: int) -> tuple[Float32, Proposals]:
    """A frame of n columns of so many points, a metre high and ten away, and its proposals."""
    xyz = np.zeros((n * points, 3), np.float32)
    xyz[:, 0] = 10.0
    xyz[:, 2] = np.tile(np.linspace(-1.0, 0.0, points), n)
    box = np.tile([10.0, 0.0, -0.5, 0.1, 0.1, 1.0, 0.0], (n, 1))
    return np.pad(xyz, ((0, 0), (0, 1))), Proposals(
        members=np.arange(len(xyz)),
        offsets=points * np.arange(n + 1),
        coordinates=xyz.T.copy(),
        centroid=box[:, :3],
        box=box,
        cut=np.zeros(n, np.int64),
        reflectance=np.zeros((n, 5)),
    )
