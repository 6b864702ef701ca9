"""Selection of the tracks to classify in a frame: the calls of greatest worth that the budget pays for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.classes import N_CLASSES
from modt.config import CallWorthConfig, CostModelConfig
from modt.types import NONE, Bool, Budget, Float64, Int, Proposals, Tracks

_POINTS_UNIT = 100.0  # points counted in hundreds, which conditions the fit


class LinearCost:
    """CPU time of a classification, linear in its number of points, estimated on the machine that runs it.

    Recursive least squares with forgetting estimates time per call and per point. A margin that follows the largest
    recent underestimate and decays slowly keeps a frame within its budget.

    Args:
        max_points: limit of the points of a proposal handed to the network.
        config: initial values and rates.
    """

    def __init__(self, max_points: int, config: CostModelConfig) -> None:
        self._max_points, self._config = max_points, config
        self.margin = 1.0
        self._theta = np.array([config.call_ms, config.point_ms])
        self._unit = np.array([1.0, _POINTS_UNIT])
        self._covariance = np.eye(2) * config.initial_variance

    def cost_ms(self, points: Int) -> Float64:
        """(R,) upper estimate of the CPU time of proposals of (R,) points [ms]."""
        per_call, per_point = np.maximum(self._theta, 1e-6)
        cost: Float64 = self.margin * (per_call + per_point * np.minimum(points, self._max_points))
        return cost

    def update(self, points: Int, cpu_ms: float) -> None:
        """Add the measured CPU time of classifying proposals of (R,) points together."""
        if not len(points) or not np.isfinite(cpu_ms) or cpu_ms <= 0:
            return
        config = self._config
        x = np.array([len(points), np.minimum(points, self._max_points).sum()]) / self._unit
        scale = 1.0 / len(points)  # per call: equal weight of frames with few and with many calls
        x, y = x * scale, cpu_ms * scale
        theta = self._theta * self._unit
        gain = self._covariance @ x / (config.forgetting + x @ self._covariance @ x)
        theta = theta + gain * (y - x @ theta)
        self._covariance = (self._covariance - np.outer(gain, x @ self._covariance)) / config.forgetting
        # Bounded by its initial trace: without excitation it would grow for ever.
        self._covariance *= min(1.0, 2 * config.initial_variance / np.trace(self._covariance))
        self._theta = theta / self._unit
        expected = float(self.cost_ms(points).sum()) / self.margin
        self.margin = max(1.0, cpu_ms / expected, 1.0 + (self.margin - 1.0) * config.margin_decay)


@dataclass(frozen=True, slots=True)
class Selection:
    """Decision of the scheduler."""

    rows: Int  # tracks to classify now, by decreasing worth
    deferred: int  # number of tracks that requested a class and have to wait


class Scheduler:
    """Greedy selection by worth.

    A call is worth more for an uncertain posterior, a view that differs from the last key view, and a near and whole
    object; and more with each frame of waiting: every call that fits into one frame's budget is made eventually.

    Args:
        config: weights of the worth.
        cost: CPU time of a call.
    """

    def __init__(self, config: CallWorthConfig, cost: LinearCost) -> None:
        self._config, self._cost = config, cost

    def select(self, tracks: Tracks, proposals: Proposals, asks: Bool, budget: Budget) -> Selection:
        """The tracks to classify in this frame; writes tracks.waiting.

        Args:
            tracks: alive.
            proposals: of this frame.
            asks: (M,) tracks that request a class, each with a proposal.
            budget: of the frame.
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
        """(R,) worth of a call for these tracks: at most 1, plus the frames waited times their weight."""
        config, proposal_rows = self._config, tracks.proposal[rows]
        posterior = np.clip(tracks.posterior[rows], 1e-12, 1.0)
        uncertainty = -(posterior * np.log(posterior)).sum(axis=1) / np.log(N_CLASSES)
        count, points_at_key_view = proposals.count[proposal_rows], tracks.key_points[rows]
        novelty = np.minimum(np.abs(count - points_at_key_view) / np.maximum(points_at_key_view, 1), 1.0)
        nearness = np.exp(-np.hypot(*proposals.box[proposal_rows, :2].T) / config.range_scale_m)
        whole = np.where(proposals.truncated[proposal_rows], config.partial_view_factor, 1.0)
        value: Float64 = whole * (
            config.uncertainty_weight * uncertainty
            + config.nearness_weight * nearness
            + config.novelty_weight * novelty
        )
        return value + config.waiting_weight * tracks.waiting[rows]

    def _affordable(self, points: Int, budget: Budget) -> Bool:
        """(R,) calls, in this order, that the budget pays for; a call that does not fit is skipped."""
        granted = np.ones(len(points), np.bool_)
        if budget.cpu_ms is not None:
            left_ms = budget.cpu_ms
            for i, cost_ms in enumerate(self._cost.cost_ms(points)):
                granted[i] = cost_ms <= left_ms
                left_ms -= cost_ms * granted[i]
        if budget.calls is not None:
            granted &= np.cumsum(granted) <= budget.calls
        return granted
