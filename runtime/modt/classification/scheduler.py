"""Selection of the tracks to classify in a frame: the calls of greatest worth that the budget pays for."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from modt.classes import N_CLASSES
from modt.classification.call_cost import LinearCost
from modt.classification.tuning import WorthTuning
from modt.types import Bool, Budget, Evidence, Float64, Int, Motion, Proposals, Requests


@dataclass(frozen=True)
class Selection:
    """Decision of the scheduler."""

    rows: Int  # tracks to classify now, by decreasing worth
    n_deferred: int  # tracks that requested a class and have to wait


class Savings:
    """CPU time that earlier frames left of a mean budget: a second's worth at most, negative after a call on credit.

    Args:
        period_s: time between two frames [s].

    Attributes:
        saved_ms: CPU time saved [ms].
        may_borrow: True if as much is saved as can be, so that a call may be made on credit.
    """

    def __init__(self, period_s: float) -> None:
        self.saved_ms = 0.0
        self.may_borrow = False
        self._period_s = period_s

    def add(self, mean_ms: float) -> None:
        """Save the budget of a further frame."""
        most_ms = mean_ms * max(1.0 / self._period_s, 1.0)
        self.saved_ms = min(self.saved_ms + mean_ms, most_ms)
        self.may_borrow = self.saved_ms >= most_ms > 0.0

    def spend(self, cpu_ms: float) -> None:
        """Take the CPU time of classifications from what is saved, if it was measured at all."""
        self.saved_ms -= cpu_ms if 0.0 <= cpu_ms < math.inf else 0.0


@dataclass(frozen=True)
class TimeLimit:
    """CPU time that the calls of a frame may take.

    Attributes:
        now_ms: CPU time that they may take in this frame [ms].
        later_ms: CPU time that they may take in a frame for which enough is saved [ms].
        is_hard: True if `later_ms` is the budget of a frame, which saving cannot raise.
        has_credit: True if one call may take more than is saved.
    """

    now_ms: float
    later_ms: float
    is_hard: bool
    has_credit: bool


class Scheduler:
    """Greedy selection by worth.

    A call is worth more for an uncertain posterior, a view that differs from the last one, and a near object; and
    more with each frame of waiting, so that every call that fits into the budget is made in the end.

    Args:
        cost: CPU time of a call.
        period_s: time between two frames [s], for a second of which a mean budget is saved.
        tuning: weights of the worth.

    Attributes:
        cost: as given.
    """

    def __init__(self, cost: LinearCost, period_s: float = 0.1, tuning: WorthTuning = WorthTuning()) -> None:
        self.cost = cost
        self._period_s = period_s
        self._tuning = tuning
        self._savings = Savings(period_s)

    def record_cost(self, points: Int, cpu_ms: float) -> None:
        """Take note of the measured CPU time of classifying proposals of (R,) points together."""
        self.cost.update(points, cpu_ms)
        self._savings.spend(cpu_ms)

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
            requests: columns of the scheduler, written.
            motion: the tracks alive.
            evidence: their classes, as known so far.
            proposals: proposals of this frame.
            asks: (M,) tracks that request a class. Those without a proposal are left out.
            budget: budget of the frame.
        """
        observed = motion.observed
        asking = (asks & observed).nonzero()[0]
        worth = self.worth(requests, motion, evidence, proposals, asking)
        ranked = asking[np.lexsort((motion.id[asking], -worth))]
        granted = self._grant(proposals.count[motion.proposal[ranked]], budget)
        deferred = ranked[~granted]
        waiting = requests.waiting[deferred] + 1
        requests.waiting[observed] = 0
        requests.waiting[deferred] = waiting
        return Selection(ranked[granted], len(deferred))

    def worth(
        self, requests: Requests, motion: Motion, evidence: Evidence, proposals: Proposals, rows: Int
    ) -> Float64:
        """(R,) worth of a call for these tracks.

        It is the weighted sum of uncertainty, nearness and novelty, each 0 to 1, plus the weighted frames waited.
        Novelty is the relative change of the number of points since the last view.
        """
        tuning = self._tuning
        proposal_of_row = motion.proposal[rows]
        posterior = np.maximum(evidence.posterior[rows], 1e-12)
        uncertainty = -(posterior * np.log(posterior)).sum(axis=1) / math.log(N_CLASSES)
        points = proposals.count[proposal_of_row]
        key_points = evidence.key_points[rows]
        novelty = np.minimum(np.abs(points - key_points) / np.maximum(key_points, 1), 1.0)
        nearness = np.exp(-np.hypot(*proposals.box[proposal_of_row, :2].T) / tuning.nearness_range_m)
        value: Float64 = (
            tuning.uncertainty_weight * uncertainty
            + tuning.nearness_weight * nearness
            + tuning.novelty_weight * novelty
            + tuning.waiting_weight * requests.waiting[rows]
        )
        return value

    def _grant(self, points: Int, budget: Budget) -> Bool:
        """(R,) calls that the budget pays for, of calls for (R,) points by decreasing worth.

        Call once a frame: its mean budget is saved first, and a starved frame is counted (`_try_exception`).
        """
        if budget.mean_ms is not None:
            self._savings.add(budget.mean_ms)
        limit = self._time_limit(budget)
        granted = np.ones(len(points), np.bool_) if limit is None else self._within(limit, points)
        if budget.calls is not None and len(points) > budget.calls:
            granted &= np.cumsum(granted) <= budget.calls
        return granted

    def _time_limit(self, budget: Budget) -> TimeLimit | None:
        """Limit of this frame's CPU time, None without any.

        Where only a mean is given, the calls of a frame may take one period, however much is saved: longer ones would
        delay the next frame.
        """
        if budget.mean_ms is None:
            return None if budget.cpu_ms is None else TimeLimit(budget.cpu_ms, budget.cpu_ms, True, False)
        is_hard = budget.cpu_ms is not None
        later_ms = max(1e3 * self._period_s, budget.mean_ms) if budget.cpu_ms is None else budget.cpu_ms
        return TimeLimit(min(self._savings.saved_ms, later_ms), later_ms, is_hard, self._savings.may_borrow)

    def _within(self, limit: TimeLimit, points: Int) -> Bool:
        """(R,) calls within the limit.

        If none fits, the first call may run by `_try_exception`. Without it, a call that costs more than every limit
        would never run.
        """
        granted = self._fitting(limit, points)
        # Padding is not in the prices of single calls: the last ones go until all together are within the limit.
        while granted.any() and self.cost.cost_ms(points[granted]) > limit.now_ms:
            granted[granted.nonzero()[0][-1]] = False
        if len(points) and not granted.any():
            granted[0] = self._try_exception(limit, points[:1])
        return granted

    def _fitting(self, limit: TimeLimit, points: Int) -> Bool:
        """(R,) calls that fit into a limit one after the other, by their prices without padding.

        A call that does not fit is skipped. If it would fit into a later frame, for which more is saved, those after
        it wait too, since they would spend what is saved for it.
        """
        granted = np.zeros(len(points), np.bool_)
        fixed_ms = self.cost.fixed_ms
        left_ms = limit.now_ms - fixed_ms
        can_save = limit.now_ms < limit.later_ms
        for call, added_ms in enumerate(self.cost.added_ms(points).tolist()):
            if added_ms <= left_ms:
                granted[call] = True
                left_ms -= added_ms
            elif can_save and added_ms <= limit.later_ms - fixed_ms:
                break
        return granted

    def _try_exception(self, limit: TimeLimit, points: Int) -> bool:
        """Whether the first call, for (1,) points, is made beyond the limit: on credit, or to correct an estimate.

        A call that costs more than the budget of a frame is refused, and the frame is counted as one without a call.
        After so many of them that the estimate is outdated, the call is made, to measure it.
        """
        if limit.is_hard and self.cost.cost_ms(points) > limit.later_ms:
            self.cost.record_starved_frame()
            return self.cost.outdated and limit.later_ms > 0
        return limit.has_credit
