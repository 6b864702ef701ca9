"""Selection of views to classify and fusion of their likelihoods (section V-C): one `pipeline.Fusion` a mode.

`asks` selects the tracks whose view is worth a classification; `fuse` takes the classifier's likelihoods and returns
which tracks are certain, upon which the state machine makes a class final or reopens it. Both write their columns of
the track table in place.
"""

from __future__ import annotations

import numpy as np

from modt.classes import N_CLASSES, ObjectClass
from modt.classification.pool import pooled_prior
from modt.classification.prior import FrequencyPrior, Prior, with_background
from modt.config import FusionConfig
from modt.types import NONE, Bool, Float64, Int, Proposals, Tracks

MIN_PROBABILITY = 1e-4
"""Floor of every likelihood and posterior: no class is excluded for good."""
_BACKGROUND = np.eye(N_CLASSES)[ObjectClass.BACKGROUND]


def update_from_boxes(tracks: Tracks, proposals: Proposals, prior: Prior, config: FusionConfig) -> None:
    """Write prior and posterior of every track with a proposal, P ~ P_view (P_box now / P_box then) ^ weight.

    Before its first view a track has the prior of its box; an inherited class has probability 1. Afterwards it has
    the posterior of its last key view, updated by the change of that prior since the view. A final class stays, but
    its posterior follows the box.

    With `mismatch_probability` the proposal is not the object of its track: the posterior is then the prior.
    """
    rows = (tracks.proposal != NONE).nonzero()[0]
    tracks.prior[rows] = prior.probability(proposals)[tracks.proposal[rows]]
    viewed = tracks.viewed[rows]
    new, known = rows[~viewed], rows[viewed]
    tracks.posterior[new] = np.where(tracks.inherited[new, None], _BACKGROUND, tracks.prior.take(new, axis=0))
    now, then = (np.maximum(p.take(known, axis=0), MIN_PROBABILITY) for p in (tracks.prior, tracks.key_prior))
    change = config.box_update_weight * np.log(now / then)
    matched = from_log_weights(np.log(tracks.key_posterior.take(known, axis=0)) + change)
    mismatch = config.mismatch_probability
    tracks.posterior[known] = (1.0 - mismatch) * matched + mismatch * tracks.prior.take(known, axis=0)


def normalise(probability: Float64) -> Float64:
    """(R, 4) rows scaled to sum 1 with entries of at least MIN_PROBABILITY; uniform where no entry is above 0."""
    finite = np.where(np.isfinite(probability), np.maximum(probability, 0.0), 0.0)
    greatest = finite.max(axis=1, keepdims=True, initial=0.0)
    relative = np.divide(finite, greatest, out=np.ones_like(finite), where=greatest > 0)
    floored = np.maximum(relative / relative.sum(axis=1, keepdims=True), MIN_PROBABILITY)
    normalised: Float64 = floored / floored.sum(axis=1, keepdims=True)
    return normalised


def from_log_weights(log_weight: Float64) -> Float64:
    """(R, 4) softmax of each row, with the floor of `normalise`."""
    return normalise(np.exp(log_weight - log_weight.max(axis=1, keepdims=True, initial=-np.inf)))


class Certainty:
    """Whether the posterior of an object, or the evidence for background, reaches its threshold.

    Background is the most frequent class and has a high posterior before any view, so its threshold applies to the
    posterior under equal class frequencies.

    Args:
        config: frequencies, and the threshold of objects.
        background_threshold: that of background.
    """

    def __init__(self, config: FusionConfig, background_threshold: float) -> None:
        frequency = np.maximum(with_background(config.prior), MIN_PROBABILITY)
        self.log_frequency: Float64 = np.log(frequency / frequency.sum())
        self._object, self._background = config.object_threshold, background_threshold

    def __call__(self, posterior: Float64) -> Bool:
        """(R,) of posteriors (R, 4)."""
        objects: Bool = posterior[:, 1:].max(axis=1, initial=0.0) >= self._object
        evidence = from_log_weights(np.log(posterior) - self.log_frequency)[:, 0]
        return objects | (evidence >= self._background)


class AnyView:
    """Every posterior is final (Table I)."""

    def __call__(self, posterior: Float64) -> Bool:
        """(R,) True of posteriors (R, 4)."""
        return np.ones(len(posterior), np.bool_)


class EveryFrame:
    """Tracking by detection: every proposal is classified, its likelihood is the posterior (Fig. 2a)."""

    def asks(self, tracks: Tracks, proposals: Proposals, wants_class: Bool) -> Bool:
        """(M,) tracks with a proposal."""
        observed: Bool = tracks.proposal != NONE
        return observed

    def fuse(self, tracks: Tracks, proposals: Proposals, rows: Int, likelihood: Float64) -> Bool:
        """Replace the posterior; every row is certain."""
        tracks.posterior[rows] = normalise(likelihood)
        tracks.views[rows] = 1
        _record_key_view(tracks, proposals, rows)
        return np.ones(len(rows), np.bool_)


class OneView(EveryFrame):
    """Mode efficient: one classification is final (Table I), the first that is certain.

    First views are often far and partial (Fig. 11), so it waits for a box that is probably an object's, and for a
    minimum number of observations, since spurious proposals do not last. An uncertain class is replaced by that of
    the first view with clearly more points. In the paper the first view is final, whatever it says.

    Args:
        config: conditions of a view, and thresholds of certainty.
        prior: of a proposal before its view; the class frequency by default.
    """

    def __init__(self, config: FusionConfig, prior: Prior | None = None) -> None:
        self.config = config
        self.prior = prior or FrequencyPrior(config.prior)
        certainty = Certainty(config, config.first_view_background_threshold)
        self._certain = AnyView() if config.first_view_final == "any" else certainty

    def asks(self, tracks: Tracks, proposals: Proposals, wants_class: Bool) -> Bool:
        """(M,) tracks without a final class that meet the conditions."""
        config = self.config
        update_from_boxes(tracks, proposals, self.prior, config)
        asks: Bool = (
            wants_class & ~tracks.final & (tracks.proposal != NONE) & (tracks.hits >= config.first_view_min_hits)
        )
        asks &= self.prior.may_be_object(tracks.prior, config.first_view_min_object_probability)
        rows = asks.nonzero()[0]
        asks[rows] = ~tracks.viewed[rows] | _has_more_points(tracks, proposals, rows, config)
        return asks

    def fuse(self, tracks: Tracks, proposals: Proposals, rows: Int, likelihood: Float64) -> Bool:
        """Replace the posterior; (R,) which rows are certain now."""
        super().fuse(tracks, proposals, rows, likelihood)
        return self._certain(tracks.posterior[rows])


class KeyViews:
    """Mode accurate: the likelihoods of independent views are multiplied (Equations 4 to 6, Table II).

    A view is independent of the last key view by its number of points or its extent. A new track is classified at
    once: a certain class is final, any other is replaced by the first view at or after `start_frame`, since first
    views are often far and partial (Fig. 11).

    The classifier returns a posterior under the class frequency and, by its pool weight, the box prior, so the
    prior is divided out of the evidence so far. Views of one object are never quite independent: with every further
    one the evidence so far counts `memory` times. A final class of few points is reviewed when the object shows
    clearly more of them; the previous evidence is then weighted by the ratio of points. Tracks whose box excludes an
    object are neither classified nor reviewed.

    Args:
        config: thresholds of independence and certainty.
        prior: of a proposal before its view; the class frequency by default.
    """

    def __init__(self, config: FusionConfig, prior: Prior | None = None) -> None:
        self.config = config
        self.prior = prior or FrequencyPrior(config.prior)
        self._point_change = np.array(config.point_change)
        self._certain = Certainty(config, config.background_threshold)
        self._log_frequency = self._certain.log_frequency

    def asks(self, tracks: Tracks, proposals: Proposals, wants_class: Bool) -> Bool:
        """(M,) tracks at their first or an independent view, and final ones to review."""
        config = self.config
        update_from_boxes(tracks, proposals, self.prior, config)
        asks, rows = wants_class.copy(), wants_class.nonzero()[0]
        started = tracks.age[rows] >= config.start_frame
        fresh = (tracks.views[rows] == 0) | self.independent(tracks, proposals, rows)
        may_be_object = self.prior.may_be_object(tracks.prior[rows], config.min_object_probability)
        asks[rows] = np.where(tracks.viewed[rows], started & fresh, may_be_object)
        return asks | self._reviewed(tracks, proposals, (tracks.final & (tracks.proposal != NONE)).nonzero()[0])

    def _reviewed(self, tracks: Tracks, proposals: Proposals, rows: Int) -> Bool:
        """(M,) tracks of these rows, all final, whose number of points has grown enough for another view."""
        config, review = self.config, np.zeros(len(tracks), np.bool_)
        review[rows] = _has_more_points(tracks, proposals, rows, config)
        review &= tracks.key_points < config.review_max_points
        return review & self.prior.may_be_object(tracks.prior, config.review_min_object_probability)

    def independent(self, tracks: Tracks, proposals: Proposals, rows: Int) -> Bool:
        """(R,) whether the view of each track differs enough from its last key view (Equation 4)."""
        config, own = self.config, tracks.proposal[rows]
        points = _relative_change(proposals.count[own], tracks.key_points[rows])
        extent = _relative_change(proposals.box[own, 3:6], tracks.key_extent[rows]).max(axis=1, initial=0.0)
        independent: Bool = points > self._point_change[np.argmax(tracks.posterior[rows], axis=1)]
        independent |= extent > config.extent_change
        return independent

    def fuse(self, tracks: Tracks, proposals: Proposals, rows: Int, likelihood: Float64) -> Bool:
        """Multiply the view into the posterior (Equation 6); (R,) which rows are certain now."""
        config, view = self.config, np.log(normalise(likelihood))
        past = np.log(normalise(tracks.key_posterior[rows])) - self._log_pooled_prior(tracks.key_prior[rows])
        ratio = tracks.key_points[rows] / np.maximum(proposals.count[tracks.proposal[rows]], 1)
        past *= np.where(tracks.final[rows], np.minimum(ratio, 1.0), 1.0)[:, None]
        fused = (tracks.views[rows] > 0)[:, None]
        posterior = from_log_weights(np.where(fused, config.memory * past + view, view))
        certain = self._certain(posterior)
        tracks.posterior[rows] = posterior
        tracks.views[rows] += certain | (tracks.age[rows] >= config.start_frame)
        _record_key_view(tracks, proposals, rows)
        return certain

    def _log_pooled_prior(self, box_prior: Float64) -> Float64:
        """(R, 4) logarithm of the prior that a likelihood contains: class frequency and box prior (R, 4)."""
        log_box = np.log(np.maximum(box_prior, MIN_PROBABILITY))
        return pooled_prior(log_box, self._log_frequency, self.prior.pool_weight)


def _has_more_points(tracks: Tracks, proposals: Proposals, rows: Int, config: FusionConfig) -> Bool:
    """(R,) whether the proposal of each track shows clearly more of it than its last key view."""
    if config.review_point_ratio is None:
        return np.zeros(len(rows), np.bool_)
    least = config.review_point_ratio * tracks.key_points[rows] + config.review_extra_points
    more: Bool = proposals.count[tracks.proposal[rows]] > least
    return more


def _relative_change(now: Float64 | Int, before: Float64 | Int) -> Float64:
    change: Float64 = np.abs(now - before) / np.maximum(before, 1e-3)
    return change


def _record_key_view(tracks: Tracks, proposals: Proposals, rows: Int) -> None:
    own = tracks.proposal[rows]
    tracks.key_prior[rows], tracks.key_posterior[rows] = tracks.prior[rows], tracks.posterior[rows]
    tracks.key_points[rows] = proposals.count[own]
    tracks.key_extent[rows] = proposals.box[own, 3:6]
