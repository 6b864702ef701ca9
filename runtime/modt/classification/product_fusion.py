"""Fusion of profile `paper`: the likelihoods of independent views are multiplied (Equations 4 to 6)."""

from __future__ import annotations

import numpy as np

from modt.classification.fusion import Confirmation, from_log_weights, log_frequency_of, normalise
from modt.classification.prior import Prior
from modt.config import FusionConfig
from modt.types import Bool, Evidence, Float64, Int, Motion, Proposals


class AnyView:
    """Mode efficient of the paper: every track is classified once, which confirms its class (Table I)."""

    def __init__(self, config: FusionConfig, prior: Prior) -> None:
        self._log_frequency = log_frequency_of(prior)

    def observe(self, evidence: Evidence, motion: Motion, proposals: Proposals) -> None:
        """Do nothing: views alone count."""

    def asks(self, evidence: Evidence, motion: Motion, proposals: Proposals, wants_class: Bool) -> Bool:
        """(M,) tracks never viewed."""
        return wants_class & ~evidence.viewed

    def fuse(self, evidence: Evidence, motion: Motion, proposals: Proposals, rows: Int, probability: Float64) -> Bool:
        """Multiply the view into the posterior; every class is confirmed."""
        posterior = from_log_weights((evidence.view_evidence[rows] + np.log(normalise(probability))).T).T
        evidence.posterior[rows] = posterior
        evidence.view_evidence[rows] = np.log(posterior) - self._log_frequency
        evidence.views[rows] += 1
        evidence.key_points[rows] = proposals.count[motion.proposal[rows]]
        return np.ones(len(rows), np.bool_)


class KeyViews(AnyView):
    """Mode accurate of the paper: views whose number of points differs are independent (Equation 4, Table II).

    A new track is classified at once, so that it has a class, but views are fused, and a class can be confirmed, only
    from `start_frame` on: first views are often far and partial (Fig. 11).
    """

    def __init__(self, config: FusionConfig, prior: Prior) -> None:
        super().__init__(config, prior)
        self._point_change = np.array(config.point_change)
        self._start_frame = config.start_frame
        self._is_confirmed = Confirmation(self._log_frequency, config.object_threshold, config.object_threshold)

    def asks(self, evidence: Evidence, motion: Motion, proposals: Proposals, wants_class: Bool) -> Bool:
        """(M,) tracks at their first or an independent view."""
        rows = wants_class.nonzero()[0]  # each has a proposal
        points = proposals.count[motion.proposal[rows]]
        key_points = evidence.key_points[rows]
        alpha = self._point_change[evidence.posterior[rows].argmax(axis=1)]  # of the likeliest class
        independent = (evidence.views[rows] == 0) | (np.abs(points - key_points) > alpha * key_points)
        asks = wants_class.copy()
        asks[rows] = ~evidence.viewed[rows] | (independent & (motion.age[rows] >= self._start_frame))
        return asks

    def fuse(self, evidence: Evidence, motion: Motion, proposals: Proposals, rows: Int, probability: Float64) -> Bool:
        """Multiply the view into the posterior (Equation 6); returns (R,) whether the class is confirmed now.

        A view before the start frame is not counted, and the next one replaces it.
        """
        evidence.view_evidence[rows[evidence.views[rows] == 0]] = 0.0
        super().fuse(evidence, motion, proposals, rows, probability)
        started: Bool = motion.age[rows] >= self._start_frame
        evidence.views[rows] -= ~started
        return self._is_confirmed(evidence.posterior[rows].T) & started
