"""Selection of views and fusion of all that is known of a track (section V-C): one `pipeline.FusionStage` a mode.

`observe` adds the boxes and the motion of a frame to the evidence of the tracks. `asks` selects the tracks whose view
is worth a classification. `fuse` takes the classifier's likelihoods and returns which tracks are certain, upon which
the state machine makes a class final or reopens it. `observe` and `fuse` write the evidence in place.

The posterior of a track after t frames, with views Y, boxes B and motion M, is

    P(X | Y_1:t, B_1:t, M_t) ~ P(X) P(M_t | X) exp(n^GROWTH mean log P(Y | X) + BOX_WEIGHT mean log P(B | X))

Views of one object are correlated (log-odds of consecutive views of a car by .8 to .87), so they are averaged, not
multiplied: n of them weigh n^GROWTH. Both means forget the past; a view counts by the root of its points. Profile
`paper` multiplies views as the paper writes it: `modt.classification.product_fusion`.
"""

from __future__ import annotations

import numpy as np

from modt.class_sizes import IS_PERSON, MAX_PERSON_M
from modt.classes import N_CLASSES, PERSON_M, ObjectClass
from modt.classification.motion_witness import log_likelihood
from modt.classification.pool import pooled_prior
from modt.classification.prior import Prior
from modt.config import FusionConfig
from modt.types import Bool, Evidence, Float64, Int, Motion, Proposals

MIN_PROBABILITY = 1e-4
"""Floor of every likelihood and posterior: no class is excluded for good."""
FORGETTING, GROWTH = 0.72, 0.22
"""Weight of the views so far at a further one, and the power of their number that they weigh together."""
BOX_FORGETTING, BOX_WEIGHT = 0.5, 0.75
"""Weight of the boxes so far at a further one, and of their mean."""
MISMATCH_PROBABILITY = 0.05
"""Probability that a proposal is not the object of its track, whose posterior is then the prior of the box."""
MORE_POINTS, FAR_MORE_POINTS, MORE_POINTS_BY = 1.25, 2.0, 5
"""An uncertain track is classified again at MORE_POINTS times the points of its last view, a certain one that may be
an object at FAR_MORE_POINTS times; each by MORE_POINTS_BY more, which is random variation."""
BACKGROUND_THRESHOLD = 0.5
"""Posterior under equal class frequencies at which background is final where it is looked at again; less: sooner."""
FIRST_VIEW_MIN_HITS = 2
"""Frames with a proposal that mode efficient waits for: more of them spare calls on spurious proposals."""
REVIEW_GROWTH, REVIEW_FRAMES = 2.0, 10
"""A certain object is classified again at REVIEW_GROWTH times its age at the last view, and REVIEW_FRAMES later."""
UNSURE_GROWTH, UNSURE_FRAMES = 1.3, 2
"""The same of an uncertain track. With longer intervals, fewer calls are made and cars are recognised later."""
LIKELY_BACKGROUND, BACKGROUND_GROWTH = 0.8, 2.0
"""Posterior from which an uncertain track is probably background, and UNSURE_GROWTH of such a track."""
MAYBE_PERSON, PERSON_FRAMES = 0.25, 4
"""Posterior from which an uncertain track may be a person, who is classified again after PERSON_FRAMES at the latest:
one view of a few points is weak evidence, and many of them are right."""
MANY_POINTS = 20
"""Points of a proposal from which mode accurate classifies what may be an object by its box, whatever its motion."""
NEAR_M = 3.0
"""Mode accurate classifies whatever may be a person as near as this, however unlikely it is one by its box [m]."""
_POWERS = np.arange(1000) ** GROWTH  # by the number of views; more of them hardly weigh more
_BACKGROUND = np.eye(N_CLASSES)[ObjectClass.BACKGROUND]


def normalise(probability: Float64) -> Float64:
    """(R, 4) rows scaled to sum 1 with entries of at least MIN_PROBABILITY; uniform where no entry is above 0."""
    finite = np.where(np.isfinite(probability), np.maximum(probability, 0.0), 0.0).T
    greatest = finite.max(axis=0, initial=0.0)
    return _floored(np.divide(finite, greatest, out=np.ones_like(finite), where=greatest > 0)).T


def from_log_weights(log_weight: Float64) -> Float64:
    """(4, R) softmax of each column of finite numbers, with the floor of `normalise`."""
    return _floored(np.exp(log_weight - log_weight.max(axis=0)))


def _floored(weight: Float64) -> Float64:
    """(4, R) columns of positive sum scaled to sum 1 with entries of at least MIN_PROBABILITY."""
    floored = np.maximum(weight / weight.sum(axis=0), MIN_PROBABILITY)
    normalised: Float64 = floored / floored.sum(axis=0)
    return normalised


def log_frequency_of(prior: Prior) -> Float64:
    """(4,) logarithm of the class frequency that a prior assumes."""
    frequency = np.maximum(prior.frequency, MIN_PROBABILITY)
    log_frequency: Float64 = np.log(frequency / frequency.sum())
    return log_frequency


class Certainty:
    """Test whether the posterior of an object, or the evidence for background, reaches its threshold.

    Background is the most frequent class and has a high posterior before any view, so its threshold applies to the
    posterior under equal class frequencies.

    Args:
        log_frequency: (4,) log of the frequencies of the classes.
        object_threshold, background_threshold: posteriors from which a class is confirmed.
    """

    def __init__(self, log_frequency: Float64, object_threshold: float, background_threshold: float) -> None:
        self._frequency = np.exp(log_frequency)
        self._object, self._background = object_threshold, background_threshold

    def __call__(self, posterior: Float64) -> Bool:
        """(R,) of posteriors (4, R)."""
        objects: Bool = posterior[1:].max(axis=0) >= self._object
        evidence = posterior / self._frequency[:, None]
        background: Bool = evidence[ObjectClass.BACKGROUND] >= self._background * evidence.sum(axis=0)
        return objects | background


class EveryFrame:
    """Tracking by detection: every proposal is classified, its likelihood is the posterior (Fig. 2a)."""

    def observe(self, evidence: Evidence, motion: Motion, proposals: Proposals) -> None:
        """Do nothing: views alone count."""

    def asks(self, evidence: Evidence, motion: Motion, proposals: Proposals, wants_class: Bool) -> Bool:
        """(M,) tracks with a proposal."""
        return motion.observed

    def fuse(self, evidence: Evidence, motion: Motion, proposals: Proposals, rows: Int, likelihood: Float64) -> Bool:
        """Replace the posterior; every row is certain."""
        evidence.posterior[rows] = normalise(likelihood)
        evidence.views[rows] = 1
        evidence.key_points[rows] = proposals.count[motion.proposal[rows]]
        return np.ones(len(rows), np.bool_)


class FusedTracks:
    """Common part of the modes that fuse: the posterior of every track with a proposal, in every frame.

    Args:
        config: condition of a view, threshold of certainty.
        prior: probabilities of the classes of a proposal before its view.
        background_threshold: evidence at which background is certain.
    """

    def __init__(
        self, config: FusionConfig, prior: Prior, background_threshold: float = BACKGROUND_THRESHOLD
    ) -> None:
        self.config, self.prior, self._log_frequency = config, prior, log_frequency_of(prior)
        self.certain = Certainty(self._log_frequency, config.object_threshold, background_threshold)

    def observe(self, evidence: Evidence, motion: Motion, proposals: Proposals) -> None:
        """Add the box and the motion of every track with a proposal to what is known of it."""
        rows = motion.observed.nonzero()[0]
        prior = self.prior.probability(proposals).T.take(motion.proposal[rows], axis=1)
        of_box, known = _log(prior) - self._log_frequency[:, None], _by_class(evidence.box_evidence, rows)
        gain = np.maximum(1.0 / motion.hits[rows], 1.0 - BOX_FORGETTING) * ~motion.hidden[rows]
        witness = log_likelihood(motion.moved_m[rows], motion.observed_s[rows], motion.size_m.take(rows, axis=0)).T
        boxes = known + gain * (of_box - known)
        evidence.prior[rows], evidence.witness[rows], evidence.box_evidence[rows] = prior.T, witness.T, boxes.T
        weighed = prior * np.exp(witness)
        probability = (weighed / weighed.sum(axis=0)).T
        evidence.may_be_object[rows] = self.prior.may_be_object(probability, self.config.min_object_probability)
        posterior = self._posterior(evidence, rows, prior, boxes, witness)
        posterior.T[motion.final[rows] & ~evidence.viewed[rows]] = _BACKGROUND  # remembered places
        evidence.posterior[rows] = posterior.T

    def fuse(self, evidence: Evidence, motion: Motion, proposals: Proposals, rows: Int, likelihood: Float64) -> Bool:
        """Add a view to what is known of the rows; (R,) which are certain now.

        The classifier returns a posterior under the class frequency and, by its pool weight, the box prior: both are
        divided out.
        """
        count = proposals.count[motion.proposal[rows]]
        prior = evidence.prior.take(rows, axis=0)
        view = np.log(normalise(likelihood)) - pooled_prior(_log(prior), self._log_frequency, self.prior.pool_weight)
        known, weight = evidence.evidence.take(rows, axis=0), np.sqrt(count)
        total = FORGETTING * evidence.weight[rows] + weight
        evidence.evidence[rows] = known + (weight / total)[:, None] * (view - known)
        evidence.weight[rows] = total
        evidence.views[rows] += 1
        evidence.key_points[rows], evidence.key_age[rows] = count, motion.age[rows]
        boxes, witness = _by_class(evidence.box_evidence, rows), _by_class(evidence.witness, rows)
        posterior = self._posterior(evidence, rows, prior.T, boxes, witness)
        evidence.posterior[rows] = posterior.T
        return self.certain(posterior)

    def _posterior(self, evidence: Evidence, rows: Int, prior: Float64, boxes: Float64, witness: Float64) -> Float64:
        """Posterior (4, R) of the rows by their views, and by their boxes and motion, (4, R) each."""
        weight = _POWERS.take(evidence.views[rows], mode="clip")
        known = self._log_frequency[:, None] + weight * _by_class(evidence.evidence, rows)
        known += BOX_WEIGHT * boxes + witness
        posterior = (1.0 - MISMATCH_PROBABILITY) * from_log_weights(known)
        posterior += MISMATCH_PROBABILITY * prior
        return posterior


class FirstViews(FusedTracks):
    """Mode efficient: the first classification that is certain is final (Table I).

    First views are often far and partial (Fig. 11), so it waits for a box that is probably an object's, and for a
    minimum number of observations, since spurious proposals do not last. A track that is uncertain is classified
    again once it shows clearly more points, and every few frames where it may be a person. Background is as final as
    an object here, and as certain.
    """

    def __init__(self, config: FusionConfig, prior: Prior) -> None:
        super().__init__(config, prior, config.object_threshold)

    def asks(self, evidence: Evidence, motion: Motion, proposals: Proposals, wants_class: Bool) -> Bool:
        """(M,) tracks without a final class that meet the conditions."""
        rows = motion.observed.nonzero()[0]
        waits = wants_class & (motion.hits >= FIRST_VIEW_MIN_HITS) & ~motion.hidden
        asks = np.zeros(len(motion), np.bool_)
        asks[rows] = evidence.may_be_object[rows] & (
            (~evidence.viewed | _shows_more(evidence, motion))[rows] | _person_waits(evidence, motion, rows)
        )
        return asks & waits


class FurtherViews(FusedTracks):
    """Mode accurate: views are fused until the class is certain, and where something changes (Table II).

    A track, a remembered place too, is classified as soon as it may be an object by box and motion, by a box of
    MANY_POINTS alone, or a person near by: the box prior takes tall people who stand for background. An uncertain one
    is classified again where it shows clearly more points, and at growing intervals, as is a certain object. Certain
    background is only where it shows far more points and may be an object. A person is not while the view cuts off
    more than half.
    """

    def asks(self, evidence: Evidence, motion: Motion, proposals: Proposals, wants_class: Bool) -> Bool:
        """(M,) tracks at their first view or one that may change their class."""
        rows = motion.observed.nonzero()[0]
        posterior = _by_class(evidence.posterior, rows)
        background, age, key_age = posterior[ObjectClass.BACKGROUND], motion.age[rows], evidence.key_age[rows]
        own, limit = motion.proposal[rows], self.config.min_object_probability
        may_be_object = evidence.may_be_object[rows] | (
            (proposals.count[own] >= MANY_POINTS) & self.prior.may_be_object(evidence.prior[rows], limit)
        )
        first = may_be_object | _near(proposals)[own]
        review = (background < 0.5) & (age >= REVIEW_GROWTH * key_age + REVIEW_FRAMES)
        review |= first & _shows_more(evidence, motion, FAR_MORE_POINTS)[rows]
        growth = np.where(background > LIKELY_BACKGROUND, BACKGROUND_GROWTH, UNSURE_GROWTH)
        unsure = _shows_more(evidence, motion)[rows] | (age >= growth * key_age + UNSURE_FRAMES)
        unsure |= _person_waits(evidence, motion, rows)
        further = np.where(self.certain(posterior), review, unsure)
        asks = np.zeros(len(motion), np.bool_)
        asks[rows] = ~motion.hidden[rows] & np.where(evidence.viewed[rows], further, first)
        return asks


def _near(proposals: Proposals) -> Bool:
    """(P,) proposals that are near, and as long and as high as a person may be."""
    x, y, _, length_m, _, height_m, _ = proposals.box.T
    near: Bool = (x * x + y * y < NEAR_M**2) & (length_m < MAX_PERSON_M) & (height_m > PERSON_M / 2)
    return near


def _person_waits(evidence: Evidence, motion: Motion, rows: Int) -> Bool:
    """(R,) rows that may be people by their posterior, and were last classified PERSON_FRAMES ago."""
    waits: Bool = _by_class(evidence.posterior, rows)[IS_PERSON].sum(axis=0) > MAYBE_PERSON
    return waits & (motion.age >= evidence.key_age + PERSON_FRAMES)[rows]


def _shows_more(evidence: Evidence, motion: Motion, ratio: float = MORE_POINTS) -> Bool:
    """(M,) tracks whose last proposal shows clearly more of them than their last view."""
    return motion.points > ratio * evidence.key_points + MORE_POINTS_BY


def _by_class(column: Float64, rows: Int) -> Float64:
    """(4, R) rows of a column (M, 4), a contiguous row a class: arithmetic along axes of four would be slow."""
    return column.take(rows, axis=0).T.copy()


def _log(probability: Float64) -> Float64:
    """Logarithm, of MIN_PROBABILITY at least."""
    return np.log(np.maximum(probability, MIN_PROBABILITY))
