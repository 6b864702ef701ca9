"""Selection of views and fusion of all that is known of a track (section V-C): one `pipeline.FusionStage` a mode.

`observe` adds the boxes and the motion of a frame to the evidence of the tracks. `asks` selects the tracks whose view
is worth a classification. `fuse` adds the classifier's probabilities and returns which classes are confirmed. The
tracker passes the result to the state machine. `observe` and `fuse` write the evidence in place.

The posterior of a track after t frames, with views Y, boxes B and motion M, is

    P(X | Y_1:t, B_1:t, M_t) ~ P(X) P(M_t | X) exp(n^view_exponent mean log P(Y | X) + box_weight mean log P(B | X))

times (1 - mismatch_probability), plus mismatch_probability P(X | B_t), in case the last box is of another object.

Views of one object are correlated (log-odds of consecutive views of a car by .8 to .87), so they are averaged, not
multiplied: n of them weigh n^view_exponent. Both means forget the past; a view counts by the root of its points, and
one of few points of what stands still less.
Profile `paper` multiplies views as the paper writes it: `modt.classification.product_fusion`.

Arrays of R tracks with a class in each row, (C, R), are contiguous by class: arithmetic along an axis as short as C
would be slow.
"""

from __future__ import annotations

import numpy as np

from modt.class_sizes import IS_PERSON, MAX_PERSON_M
from modt.classes import PERSON_HEIGHT_M, ObjectClass
from modt.classification.motion_likelihood import MotionLikelihood
from modt.classification.pool import pooled_prior
from modt.classification.prior import Prior
from modt.classification.tuning import FusionTuning
from modt.config import FusionConfig
from modt.types import Bool, Cut, Evidence, Float64, Int, Motion, MotionState, Proposals

MIN_PROBABILITY = 1e-4
"""Floor of every likelihood and posterior: no class is excluded for good."""
_MAX_VIEWS = 1000
"""Number of views from which further ones add no weight."""


def normalise(probability: Float64) -> Float64:
    """(R, C) rows scaled to sum 1 with entries of at least MIN_PROBABILITY; uniform where no entry is above 0."""
    finite = np.where(np.isfinite(probability), np.maximum(probability, 0.0), 0.0).T
    greatest = finite.max(axis=0, initial=0.0)
    return _floored(np.divide(finite, greatest, out=np.ones_like(finite), where=greatest > 0)).T


def from_log_weights(log_weight: Float64) -> Float64:
    """(C, R) softmax of each column of finite numbers, with the floor of `normalise`."""
    return _floored(np.exp(log_weight - log_weight.max(axis=0)))


def _floored(weight: Float64) -> Float64:
    """(C, R) columns of positive sum scaled to sum 1 with entries of at least MIN_PROBABILITY."""
    floored = np.maximum(weight / weight.sum(axis=0), MIN_PROBABILITY)
    normalised: Float64 = floored / floored.sum(axis=0)
    return normalised


def _log(probability: Float64) -> Float64:
    """Logarithm of probabilities, of MIN_PROBABILITY at least."""
    return np.log(np.maximum(probability, MIN_PROBABILITY))


def log_frequency_of(prior: Prior) -> Float64:
    """(C,) logarithm of the class frequency that a prior assumes."""
    frequency = np.maximum(prior.frequency, MIN_PROBABILITY)
    log_frequency: Float64 = np.log(frequency / frequency.sum())
    return log_frequency


class Confirmation:
    """Test whether the posterior of an object, or the evidence for background, reaches its threshold.

    Background is the most frequent class and has a high posterior before any view, so its threshold applies to the
    posterior under equal class frequencies.

    Args:
        log_frequency: (C,) log of the frequencies of the classes.
        object_threshold, background_threshold: posteriors from which a class is confirmed.
    """

    def __init__(self, log_frequency: Float64, object_threshold: float, background_threshold: float) -> None:
        self._frequency = np.exp(log_frequency)
        self._object_threshold = object_threshold
        self._background_threshold = background_threshold

    def __call__(self, posterior: Float64) -> Bool:
        """(R,) whether a class is confirmed by posteriors (C, R)."""
        is_object: Bool = posterior[1:].max(axis=0) >= self._object_threshold
        under_equal = posterior / self._frequency[:, None]
        threshold = self._background_threshold * under_equal.sum(axis=0)
        is_background: Bool = under_equal[ObjectClass.BACKGROUND] >= threshold
        return is_object | is_background


class EveryFrame:
    """Tracking by detection: every proposal is classified, and its class probability is the posterior (Fig. 2a)."""

    def observe(self, evidence: Evidence, motion: Motion, proposals: Proposals) -> None:
        """Do nothing: views alone count."""

    def asks(self, evidence: Evidence, motion: Motion, proposals: Proposals, wants_class: Bool) -> Bool:
        """(M,) tracks with a proposal."""
        return motion.observed

    def fuse(self, evidence: Evidence, motion: Motion, proposals: Proposals, rows: Int, probability: Float64) -> Bool:
        """Replace the posterior; every class is confirmed."""
        evidence.posterior[rows] = normalise(probability)
        evidence.views[rows] = 1
        evidence.key_points[rows] = proposals.count[motion.proposal[rows]]
        return np.ones(len(rows), np.bool_)


class FusedTracks:
    """Common part of the modes that fuse: the posterior of every track with a proposal, in every frame.

    Args:
        config: condition of a view, threshold of an object.
        prior: probabilities of the classes of a proposal before its view.
        tuning: weights of the evidence, and conditions of a view.
    """

    def __init__(self, config: FusionConfig, prior: Prior, tuning: FusionTuning = FusionTuning()) -> None:
        self._prior = prior
        self._min_object_probability = config.min_object_probability
        self._weights = tuning.evidence
        self._conditions = tuning.requests
        self._motion_likelihood = MotionLikelihood(tuning.motion)
        self._whole_m = tuning.motion.whole_m
        self._weight_of_views = np.arange(_MAX_VIEWS) ** tuning.evidence.view_exponent
        self._log_frequency = log_frequency_of(prior)
        self._is_confirmed = Confirmation(
            self._log_frequency, config.object_threshold, tuning.evidence.background_threshold
        )

    def observe(self, evidence: Evidence, motion: Motion, proposals: Proposals) -> None:
        """Add the box and the motion of every track with a proposal to what is known of it."""
        rows = motion.observed.nonzero()[0]
        prior = self._prior.probability(proposals).T.take(motion.proposal[rows], axis=1)
        size_m = motion.size_m.take(rows, axis=0)
        is_whole = self._shows_whole(proposals).take(motion.proposal[rows])
        motion_evidence = self._motion_likelihood.log_ratio(
            motion.moved_m[rows], motion.observed_s[rows], size_m, is_whole
        )
        # Plain mean of the first boxes, then an exponential one; boxes of hidden people are left out.
        box_evidence = _by_class(evidence.box_evidence, rows)
        gain = np.maximum(1.0 / motion.hits[rows], 1.0 - self._weights.box_memory) * ~motion.top_cut[rows]
        box_evidence += gain * (_log(prior) - self._log_frequency[:, None] - box_evidence)
        evidence.prior[rows] = prior.T
        evidence.motion_evidence[rows] = motion_evidence.T
        evidence.box_evidence[rows] = box_evidence.T
        weighted = prior * np.exp(motion_evidence)
        evidence.may_be_object[rows] = self._may_be_object((weighted / weighted.sum(axis=0)).T)
        evidence.posterior[rows] = self._posterior(evidence, rows, prior, box_evidence, motion_evidence).T

    def fuse(self, evidence: Evidence, motion: Motion, proposals: Proposals, rows: Int, probability: Float64) -> Bool:
        """Add a view to what is known of the rows (R,); returns (R,) whether the class is confirmed now.

        The classifier's `probability` (R, C) is P(class | points) under the class frequency, times the box's odds of
        an object if the classifier pooled them (`pool_weight`). Both are divided out.
        """
        points = proposals.count[motion.proposal[rows]]
        prior = evidence.prior.take(rows, axis=0)
        assumed = pooled_prior(_log(prior), self._log_frequency, self._prior.pool_weight(proposals))
        view = np.log(normalise(probability)) - assumed
        # A view of few points tells little. Only tracks that are known to be still have it weakened for that.
        is_still = motion.motion[rows] == MotionState.STILL.value
        view *= np.where(is_still, np.minimum(1.0, points / self._weights.full_points), 1.0)[:, None]
        mean = evidence.view_evidence.take(rows, axis=0)
        weight = np.sqrt(points)
        total = self._weights.view_memory * evidence.view_weight[rows] + weight
        evidence.view_evidence[rows] = mean + (weight / total)[:, None] * (view - mean)
        evidence.view_weight[rows] = total
        evidence.views[rows] += 1
        evidence.key_points[rows] = points
        evidence.key_age[rows] = motion.age[rows]
        box_evidence = _by_class(evidence.box_evidence, rows)
        motion_evidence = _by_class(evidence.motion_evidence, rows)
        posterior = self._posterior(evidence, rows, prior.T, box_evidence, motion_evidence)
        evidence.posterior[rows] = posterior.T
        return self._is_confirmed(posterior)

    def _posterior(self, evidence: Evidence, rows: Int, prior: Float64, boxes: Float64, motion: Float64) -> Float64:
        """(C, R) posterior of the rows (R,).

        Args:
            evidence: the views.
            rows: (R,) tracks.
            prior: (C, R) P(class | box) of the last box.
            boxes: (C, R) evidence of the boxes.
            motion: (C, R) evidence of the motion.
        """
        weight = self._weight_of_views.take(evidence.views[rows], mode="clip")
        log_weight = self._log_frequency[:, None] + weight * _by_class(evidence.view_evidence, rows)
        log_weight += self._weights.box_weight * boxes + motion
        posterior = (1.0 - self._weights.mismatch_probability) * from_log_weights(log_weight)
        posterior += self._weights.mismatch_probability * prior
        return posterior

    def _shows_whole(self, proposals: Proposals) -> Bool:
        """(P,) proposals that are near, and not cut at a side."""
        x, y = proposals.box[:, :2].T
        whole: Bool = x * x + y * y < self._whole_m**2
        whole &= (proposals.cut & (Cut.SIDE | Cut.NEAR).value) == 0
        return whole

    def _may_be_object(self, probability: Float64) -> Bool:
        """(R,) whether probabilities (R, C) leave an object likely enough for a classification."""
        return self._prior.may_be_object(probability, self._min_object_probability)

    def _shows_more(self, evidence: Evidence, motion: Motion, rows: Int, ratio: float) -> Bool:
        """(R,) tracks of which the last proposal shows clearly more points than the last view."""
        return motion.points[rows] > ratio * evidence.key_points[rows] + self._conditions.more_points_offset

    def _is_person_due(self, evidence: Evidence, motion: Motion, rows: Int, posterior: Float64) -> Bool:
        """(R,) tracks that may be people by their posterior (C, R), and whose last view is some frames ago."""
        maybe_person: Bool = posterior[IS_PERSON].sum(axis=0) > self._conditions.maybe_person
        return maybe_person & (motion.age[rows] >= evidence.key_age[rows] + self._conditions.person_frames)


class FirstViews(FusedTracks):
    """Mode efficient: the first view that confirms a class is the last (Table I).

    First views are often far and partial (Fig. 11), so it waits for a box that is probably an object's, and for a
    minimum number of observations, since spurious proposals do not last. An unconfirmed track is classified again
    once it shows clearly more points, and every few frames where it may be a person. Background gets no review, so it
    needs the same threshold as an object.
    """

    def __init__(self, config: FusionConfig, prior: Prior, tuning: FusionTuning = FusionTuning()) -> None:
        super().__init__(config, prior, tuning)
        self._is_confirmed = Confirmation(self._log_frequency, config.object_threshold, config.object_threshold)

    def asks(self, evidence: Evidence, motion: Motion, proposals: Proposals, wants_class: Bool) -> Bool:
        """(M,) tracks without a confirmed class that meet the conditions."""
        rows = motion.observed.nonzero()[0]
        posterior = _by_class(evidence.posterior, rows)
        is_due = ~evidence.viewed[rows]
        is_due |= self._shows_more(evidence, motion, rows, self._conditions.more_points_ratio)
        is_due |= self._is_person_due(evidence, motion, rows, posterior)
        asks = np.zeros(len(motion), np.bool_)
        asks[rows] = evidence.may_be_object[rows] & is_due
        return asks & wants_class & (motion.hits >= self._conditions.first_view_min_hits) & ~motion.top_cut


class FurtherViews(FusedTracks):
    """Mode accurate: views are fused until the class is confirmed, and where something changes (Table II).

    A track has its first view as soon as box and motion, a box of many points alone, or a
    nearby box of a person's size allow an object. A track of many points within some distance has it whatever its box
    is: the box prior takes people in rare postures for background. An unconfirmed track is
    classified again when it shows more points, at growing intervals, and every few frames if it may be a person. A
    confirmed object is classified again at longer intervals. A confirmed track of any class is classified again with
    far more points, if it may be an object. A person whose upper half is cut off is not classified. A class counts as
    confirmed here by the present posterior, whatever `Motion.final` says, and every state may ask for a view.
    """

    def asks(self, evidence: Evidence, motion: Motion, proposals: Proposals, wants_class: Bool) -> Bool:
        """(M,) tracks at their first view or one that may change their class; `wants_class` is not regarded."""
        conditions = self._conditions
        rows = motion.observed.nonzero()[0]
        age = motion.age[rows]
        key_age = evidence.key_age[rows]
        posterior = _by_class(evidence.posterior, rows)
        background = posterior[ObjectClass.BACKGROUND]
        # An object by box and motion, by the box alone if it shows many points, or near by: worth a first view.
        proposal_of_row = motion.proposal[rows]
        many_points = proposals.count[proposal_of_row] >= conditions.first_view_points
        may_be_object = evidence.may_be_object[rows] | (many_points & self._may_be_object(evidence.prior[rows]))
        may_be_object |= self._may_be_near_person(proposals)[proposal_of_row]
        first = may_be_object | (many_points & self._is_near_and_lasting(motion, proposals, rows))
        # Views of a confirmed class: of an object at growing intervals, of any class with far more points.
        review = (background < 0.5) & (age >= conditions.review_age_ratio * key_age + conditions.review_frames)
        review |= may_be_object & self._shows_more(evidence, motion, rows, conditions.far_more_points_ratio)
        # Views of an unconfirmed one: at shorter intervals, with more points, of a possible person every few frames.
        is_likely_background = background > conditions.likely_background
        ratio = np.where(is_likely_background, conditions.background_age_ratio, conditions.unconfirmed_age_ratio)
        unconfirmed = age >= ratio * key_age + conditions.unconfirmed_frames
        unconfirmed |= self._shows_more(evidence, motion, rows, conditions.more_points_ratio)
        unconfirmed |= self._is_person_due(evidence, motion, rows, posterior)
        further = np.where(self._is_confirmed(posterior), review, unconfirmed)
        asks = np.zeros(len(motion), np.bool_)
        asks[rows] = ~motion.top_cut[rows] & np.where(evidence.viewed[rows], further, first)
        return asks

    def _is_near_and_lasting(self, motion: Motion, proposals: Proposals, rows: Int) -> Bool:
        """(R,) tracks that are nearer than `unseen_m` and were seen in `unseen_hits` frames."""
        conditions = self._conditions
        x, y = proposals.box[motion.proposal[rows], :2].T
        is_near: Bool = x * x + y * y < conditions.unseen_m**2
        is_near &= motion.hits[rows] >= conditions.unseen_hits
        return is_near

    def _may_be_near_person(self, proposals: Proposals) -> Bool:
        """(P,) proposals that are near, at most as long as a person, and at least half as high."""
        x, y, _, length_m, _, height_m, _ = proposals.box.T
        near: Bool = x * x + y * y < self._conditions.near_m**2
        near &= (length_m < MAX_PERSON_M) & (height_m > PERSON_HEIGHT_M / 2)
        return near


def _by_class(column: Float64, rows: Int) -> Float64:
    """(C, R) rows of a column (M, C), contiguous by class."""
    return column.take(rows, axis=0).T.copy()
