"""Who is classified in this frame: the worthiest calls that its budget pays for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from modt.classes import N_CLASSES
from modt.types import NONE, Bool, Budget, Float64, Int, Proposals, Tracks

WAITING_WORTH = 0.1
"""What a frame of waiting adds to the worth of a call, itself at most 1: a track that has waited for 1 / this many
frames goes before whatever asks for the first time, so that none starves."""
NEAR_M = 30.0
"""At this distance closeness is worth 1/e of what it is at the sensor."""


class CostModel(Protocol):
    """What classifying a proposal costs."""

    def cost_ms(self, points: Int) -> Float64:
        """(R,) CPU time of proposals of so many points [ms]."""
        ...

    def learn(self, points: Int, cpu_ms: float) -> None:
        """Take in what classifying proposals of so many points together did cost."""
        ...


class LinearCost:
    """So much a proposal and so much a point, learnt on the machine it runs on.

    Recursive least squares with forgetting finds the two; a margin that follows the worst recent underestimate, and
    decays slowly, keeps a frame from overshooting its budget. Until it has learnt it assumes the textbook's cost.

    Args:
        max_points: more points than this are not handed to the network.
        per_call_ms, per_point_ms: cost assumed at first.
        forget: weight of the past against the next frame.
    """

    def __init__(
        self, max_points: int = 400, per_call_ms: float = 0.1, per_point_ms: float = 0.001, forget: float = 0.98
    ) -> None:
        self.max_points, self.forget = max_points, forget
        self.margin = 1.0
        self._theta = np.array([per_call_ms, per_point_ms])
        self._unit = np.array([1.0, 100.0])  # a call, a hundred points: of like weight in the fit
        self._covariance = np.eye(2) * 10.0

    def cost_ms(self, points: Int) -> Float64:
        """(R,) CPU time of proposals of so many points [ms], on the safe side."""
        per_call, per_point = np.maximum(self._theta, 1e-6)
        cost: Float64 = self.margin * (per_call + per_point * np.minimum(points, self.max_points))
        return cost

    def learn(self, points: Int, cpu_ms: float) -> None:
        """Take in what classifying proposals of so many points together did cost."""
        if not len(points) or not np.isfinite(cpu_ms) or cpu_ms <= 0:
            return
        x = np.array([len(points), np.minimum(points, self.max_points).sum()]) / self._unit
        scale = 1.0 / len(points)  # per call: frames of few and of many calls count alike
        x, y = x * scale, cpu_ms * scale
        theta = self._theta * self._unit
        gain = self._covariance @ x / (self.forget + x @ self._covariance @ x)
        theta = theta + gain * (y - x @ theta)
        self._covariance = (self._covariance - np.outer(gain, x @ self._covariance)) / self.forget
        self._covariance *= min(1.0, 20.0 / np.trace(self._covariance))  # like frames all along must not blow it up
        self._theta = theta / self._unit
        expected = float(self.cost_ms(points).sum()) / self.margin
        self.margin = max(1.0, cpu_ms / expected, 1.0 + (self.margin - 1.0) * 0.95)


@dataclass(frozen=True, slots=True)
class Selection:
    """What the scheduler decided.

    Attributes:
        rows: tracks to classify now, the worthiest first.
        deferred: tracks that asked and must wait.
    """

    rows: Int
    deferred: int


class Scheduler:
    """Grants calls in the order of their worth until the budget is spent.

    A call is worth more the less is known of the track, the more its view differs from the last one fused, the
    nearer it is and the more of it is seen; and more with every frame it waits. Whatever fits into a frame's budget
    by itself is therefore served in the end.

    Args:
        cost: what a call costs; a model of its own that assumes the textbook's cost where none is given.
    """

    def __init__(self, cost: CostModel | None = None) -> None:
        self.cost = cost or LinearCost()

    def select(self, tracks: Tracks, proposals: Proposals, asks: Bool, budget: Budget) -> Selection:
        """The tracks to classify in this frame; writes tracks.waiting.

        Args:
            tracks: alive, each with its proposal.
            proposals: of this frame.
            asks: (M,) which want a class; a track without a proposal must not.
            budget: what the frame may spend.
        """
        asking = np.flatnonzero(asks & (tracks.proposal != NONE))
        worth = self.worth(tracks, proposals, asking)
        ranked = asking[np.lexsort((tracks.id[asking], -worth))]
        granted = self._affordable(proposals.count[tracks.proposal[ranked]], budget)
        tracks.waiting[~asks & (tracks.proposal != NONE)] = 0
        tracks.waiting[ranked[granted]] = 0
        tracks.waiting[ranked[~granted]] += 1
        return Selection(ranked[granted], int(np.count_nonzero(~granted)))

    def worth(self, tracks: Tracks, proposals: Proposals, rows: Int) -> Float64:
        """(R,) what a call is worth: at most 1, and more for each frame waited."""
        own = tracks.proposal[rows]
        posterior = np.clip(tracks.posterior[rows], 1e-12, 1.0)
        uncertainty = -(posterior * np.log(posterior)).sum(axis=1) / np.log(N_CLASSES)
        count, key = proposals.count[own], tracks.key_points[rows]
        novelty = np.minimum(np.abs(count - key) / np.maximum(key, 1), 1.0)
        nearness = np.exp(-np.hypot(*proposals.box[own, :2].T) / NEAR_M)
        whole = 1.0 - 0.5 * (proposals.truncated[own] | proposals.occluded[own])
        value: Float64 = whole * (0.4 * uncertainty + 0.3 * nearness + 0.3 * novelty)
        return value + WAITING_WORTH * tracks.waiting[rows]

    def _affordable(self, points: Int, budget: Budget) -> Bool:
        """(R,) which calls, in this order, the budget pays for; what does not fit lets smaller ones pass."""
        granted = np.ones(len(points), np.bool_)
        if budget.cpu_ms is not None:
            cost = self.cost.cost_ms(points)
            if cost.sum() > budget.cpu_ms:
                granted = _fitting(cost, budget.cpu_ms)
        if budget.calls is not None:
            granted &= np.cumsum(granted) <= budget.calls
        return granted


def _fitting(cost: Float64, budget: float) -> Bool:
    """Greedy: each in its turn if what is left pays for it."""
    granted = np.zeros(len(cost), np.bool_)
    for i, price in enumerate(cost):  # a frame's few askers, only when the budget binds
        if price <= budget:
            granted[i] = True
            budget -= price
    return granted
