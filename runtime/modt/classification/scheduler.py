"""Selection of the tracks to classify in a frame: the calls of greatest worth that the budget pays for."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np

from modt.classes import N_CLASSES
from modt.classification.crops import batches
from modt.config import ClassificationConfig
from modt.types import Bool, Budget, Evidence, Float32, Float64, Int, Motion, Proposals, Requests


def padded_size(limits: ClassificationConfig) -> Callable[[Int], int]:
    """Points that the network processes, padding included, for proposals of (R,) points.

    A call takes a batch of proposals, of max_points each at most, padded to the largest of them and to min_points.
    """
    return partial(_padded, limits.max_points, limits.min_points, limits.batch)


def _padded(most: int, least: int, batch: int, count: Int) -> int:
    size = sorted(max(min(n, most), least) for n in count.tolist())  # few: faster than arrays
    return sum((rows.stop - rows.start) * size[rows.stop - 1] for rows in batches(size, batch))


UNCERTAINTY_WEIGHT, NEARNESS_WEIGHT, NOVELTY_WEIGHT = 0.4, 0.3, 0.3
"""Weights in the worth of a call: of the normalised entropy of the posterior, of exp(-distance / NEARNESS_RANGE_M),
and of the relative change of points since the last view. They decide who comes first where the budget binds."""
NEARNESS_RANGE_M = 30.0
"""Distance at which nearness is 1/e [m]: with less, far objects wait longer."""
WAITING_WEIGHT = 0.1
"""Worth added per frame of waiting, so that every call is made in the end."""
FORGETTING = 0.98
"""Weight per frame of the past in the fit of a call's cost: with less, it follows the machine faster."""
START_MARGIN, MARGIN_STEP = 1.5, 0.05
"""The estimate of a call's cost over the fit, at the start, and by how much an underestimate raises its logarithm."""
_POINTS = 100.0  # the unit of points, which conditions the fit
_DIAGONAL = np.eye(3)
_LEAST_MS = 1e-3  # what takes less was not measured
_WARM_UP_WEIGHT = 0.2  # of a measurement before the first frame, over that of a frame's
_UNDERESTIMATES = 0.005  # share accepted: half of the hundredth in which a frame may exceed its budget
_STARVED_FRAMES = 100  # after which a call that may exceed the budget finds out


class LinearCost:
    """CPU time of the classifications of a frame: linear in their number and points, as measured on this machine.

    Least squares with forgetting, of errors relative to the time measured, so that a spike hardly counts. A margin
    that grows with each underestimate, by a step, and shrinks slowly otherwise keeps these rare. Without measurements
    the margin shrinks on, and what was measured before counts less once there is a new one.

    Args:
        max_points: limit of the points of a proposal handed to the network.
        size: points that the network processes, padding included, for proposals of (R,) points.
    """

    def __init__(self, max_points: int, size: Callable[[Int], int]) -> None:
        self._max_points, self.size = max_points, size
        self._margin, self._starved = START_MARGIN, 0
        self._equations = np.zeros((3, 4))
        self._fitted_ms: Float64 | None = None

    @property
    def outdated(self) -> bool:
        """True after so many frames without a call that a measurement is worth exceeding the budget."""
        return self._starved >= _STARVED_FRAMES

    def cost_ms(self, points: Int) -> float:
        """Upper estimate of the CPU time of classifying proposals of (R,) points together [ms]."""
        return float(self._terms(points) @ self._terms_ms())

    def added_ms(self, points: Int) -> Float64:
        """(R,) what each proposal of (R,) points adds to that at least, without padding [ms]."""
        _, call_ms, points_ms = self._terms_ms()
        added: Float64 = call_ms + points_ms / _POINTS * np.minimum(points, self._max_points)
        return added

    def warmed_up(self, points: Int, cpu_ms: float) -> None:
        """Add the CPU time that classifying proposals of (R,) points together took before the first frame."""
        if cpu_ms >= _LEAST_MS:
            self._learn(self._terms(points), cpu_ms, _WARM_UP_WEIGHT)

    def update(self, points: Int, cpu_ms: float) -> None:
        """Add the measured CPU time of classifying proposals of (R,) points together."""
        if len(points) and _LEAST_MS <= cpu_ms < math.inf:
            terms = self._terms(points)
            self._adapt(cpu_ms > float(terms @ self._terms_ms()))
            self._equations *= FORGETTING ** (1 + self._starved)
            self._learn(terms, cpu_ms, 1.0)
            self._starved = 0

    def starve(self) -> None:
        """Add a frame that allowed none of the calls asked for."""
        self._adapt(False)
        self._starved += 1

    def _adapt(self, underestimated: bool) -> None:
        step = MARGIN_STEP * (underestimated - _UNDERESTIMATES)
        self._margin = max(1.0, self._margin * math.exp(step))

    def _learn(self, terms: Float64, cpu_ms: float, weight: float) -> None:
        """Add to the normal equations of terms_ms @ x = 1."""
        row = np.ones(4)
        row[:3] = terms / cpu_ms
        self._equations += weight * row[:3, None] * row
        self._fitted_ms = None

    def _terms(self, points: Int) -> Float64:
        return np.array([1.0, len(points), self.size(points) / _POINTS])

    def _terms_ms(self) -> Float64:
        """(3,) upper estimate of each term's CPU time [ms]."""
        if self._fitted_ms is None:
            normal, right = self._equations[:, :3], self._equations[:, 3]
            little = _DIAGONAL * (1e-9 + 1e-6 * normal.trace())
            self._fitted_ms = np.maximum(np.linalg.solve(normal + little, right), 0.0)
        return self._margin * self._fitted_ms


@dataclass(frozen=True, slots=True)
class Selection:
    """Decision of the scheduler."""

    rows: Int  # tracks to classify now, by decreasing worth
    deferred: int  # number of tracks that requested a class and have to wait


class Scheduler:
    """Greedy selection by worth.

    A call is worth more for an uncertain posterior, a view that differs from the last one, and a near and whole
    object; and more with each frame of waiting: every call that fits into the budget is made eventually.

    Args:
        cost: CPU time of a call.
        period_s: time between two frames, for a second of which a mean budget is saved.
    """

    def __init__(self, cost: LinearCost, period_s: float = 0.1) -> None:
        self.cost, self._period_s = cost, period_s
        self._saved_ms = 0.0  # of a mean budget; negative after a call beyond it

    def paid(self, points: Int, cpu_ms: float) -> None:
        """Take note of the measured CPU time of classifying proposals of (R,) points together."""
        self.cost.update(points, cpu_ms)
        self._saved_ms -= cpu_ms if 0.0 <= cpu_ms < math.inf else 0.0

    def select(
        self,
        requests: Requests,
        motion: Motion,
        evidence: Evidence,
        proposals: Proposals,
        asks: Bool,
        budget: Budget,
    ) -> Selection:
        """The tracks to classify in this frame; writes how long the others have waited.

        Args:
            requests: written.
            motion: of the tracks alive.
            evidence: of the same.
            proposals: proposals of this frame.
            asks: (M,) tracks that request a class, each with a proposal.
            budget: budget of the frame.
        """
        observed = motion.observed
        asking = (asks & observed).nonzero()[0]
        worth = self.worth(requests, motion, evidence, proposals, asking)
        ranked = asking[np.lexsort((motion.id[asking], -worth))]
        granted = self._affordable(proposals.count[motion.proposal[ranked]], budget)
        deferred = ranked[~granted]
        waiting = requests.waiting[deferred] + 1
        requests.waiting[observed] = 0
        requests.waiting[deferred] = waiting
        return Selection(ranked[granted], len(deferred))

    def worth(
        self, requests: Requests, motion: Motion, evidence: Evidence, proposals: Proposals, rows: Int
    ) -> Float64:
        """(R,) worth of a call for these tracks: at most 1, plus the frames waited times their weight."""
        proposal_rows = motion.proposal[rows]
        posterior = np.maximum(evidence.posterior[rows], 1e-12)
        uncertainty = -(posterior * np.log(posterior)).sum(axis=1) / math.log(N_CLASSES)
        count, last_points = proposals.count[proposal_rows], evidence.key_points[rows]
        novelty = np.minimum(np.abs(count - last_points) / np.maximum(last_points, 1), 1.0)
        nearness = np.exp(-np.hypot(*proposals.box[proposal_rows, :2].T) / NEARNESS_RANGE_M)
        value: Float64 = (
            UNCERTAINTY_WEIGHT * uncertainty
            + NEARNESS_WEIGHT * nearness
            + NOVELTY_WEIGHT * novelty
            + WAITING_WEIGHT * requests.waiting[rows]
        )
        return value

    def _affordable(self, points: Int, budget: Budget) -> Bool:
        """(R,) calls, in this order, that the budget pays for.

        A call that does not fit into the frame is skipped. One that is beyond what is saved of a mean budget makes
        those after it wait; once a second's worth is saved, it is made on credit.
        """
        granted, full = np.ones(len(points), np.bool_), False
        frame_ms = limit_ms = budget.cpu_ms
        if budget.mean_ms is not None:
            most_ms = budget.mean_ms * max(1.0 / self._period_s, 1.0)
            self._saved_ms = min(self._saved_ms + budget.mean_ms, most_ms)
            full = self._saved_ms >= most_ms > 0.0
            frame_ms = max(1e3 * self._period_s, budget.mean_ms) if frame_ms is None else frame_ms
            limit_ms = min(self._saved_ms, frame_ms)
        if limit_ms is not None and frame_ms is not None:
            idle_ms = self.cost.cost_ms(points[:0])
            left_ms = limit_ms - idle_ms
            for i, added_ms in enumerate(self.cost.added_ms(points).tolist()):
                granted[i] = added_ms <= left_ms
                left_ms -= added_ms * granted[i]
                if left_ms < added_ms <= frame_ms - idle_ms and not granted[i] and limit_ms < frame_ms:
                    left_ms = -1.0
            while granted.any() and self.cost.cost_ms(points[granted]) > limit_ms:  # by padding
                granted[granted.nonzero()[0][-1]] = False
            if len(points) and not granted.any():
                if self.cost.cost_ms(points[:1]) <= frame_ms or budget.cpu_ms is None:
                    granted[0] = full
                else:
                    self.cost.starve()
                    granted[0] = self.cost.outdated and frame_ms > 0
        if budget.calls is not None and len(points) > budget.calls:
            granted &= np.cumsum(granted) <= budget.calls
        return granted


_ROUNDS = 5
_FEW_POINTS = 8
_CACHE_BYTES = 4 << 20
"""Written before each call of the warm-up: between two frames other stages fill the caches."""


Classify = Callable[[Float32, Proposals, Int], Float64]
"""Likelihoods (R, 4) of the proposals of a frame that are named by index."""


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
    xyz[:, 0], xyz[:, 2] = 10.0, np.tile(np.linspace(-1.0, 0.0, points), n)
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
