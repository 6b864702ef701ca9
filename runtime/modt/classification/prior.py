"""Class prior of a proposal before the network sees its points: by class frequency, or by its box and reflectance."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from modt.classes import N_CLASSES, ObjectClass
from modt.classification.box_classifier import BoxClassifier, NoBoxClassifier, is_bound, proposal_features
from modt.classification.pool import PoolWeights, softmax
from modt.classification.reflectance_classifier import NoReflectanceClassifier, ReflectanceClassifier
from modt.config import SensorConfig
from modt.types import Bool, Float64, Proposals


class BoxScores:
    """The box classifier and the reflectance classifier of a model, side by side.

    The prior of the tracks and the classifier's pool need the same scores of the same proposals: those of the last
    frame are kept.

    Args:
        boxes: P(class | box).
        reflectance: P(reflectance | class, box).
        sensor: spacing of its beams, and its height where the proposals have none.
    """

    def __init__(self, boxes: BoxClassifier, reflectance: ReflectanceClassifier, sensor: SensorConfig) -> None:
        self.boxes, self.reflectance, self._sensor = boxes, reflectance, sensor
        self._beams, self._proposals = sensor.beams, Proposals.empty()
        self._scores = np.zeros((0, N_CLASSES)), np.zeros((0, N_CLASSES))

    @property
    def informative(self) -> bool:
        """Whether there is either classifier."""
        return not (isinstance(self.boxes, NoBoxClassifier) and isinstance(self.reflectance, NoReflectanceClassifier))

    @property
    def weights(self) -> PoolWeights:
        """In the pool with the network, of the proposals last given: without reflectance the network counts more."""
        told = None if self._proposals.reflectance is None else self.reflectance.weights
        return told or self.boxes.weights

    def of(self, proposals: Proposals) -> tuple[Float64, Float64]:
        """(P, 4) log P(class | box) and (P, 4) log P(reflectance | class, box), up to constants."""
        if proposals is not self._proposals:
            features = proposal_features(proposals, self._sensor, self._beams)
            boxes = self.boxes.log_probability(features, proposals.cut)
            reflectance = self.reflectance.log_likelihood(features, proposals.reflectance)
            self._proposals, self._scores = proposals, (boxes, reflectance)
            self._bound = is_bound(features, proposals.cut)
        return self._scores

    def bound(self, proposals: Proposals) -> Bool:
        """(P,) proposals that the view cuts where a person may go on."""
        self.of(proposals)
        return self._bound


class Prior(Protocol):
    """P(class) of proposals that are not classified yet."""

    frequency: Float64
    """(4,) frequency of the classes among proposals."""

    @property
    def pool_weight(self) -> float:
        """Exponent of what the prior says of an object, in the classifier's pool (0 to 1)."""

    def probability(self, proposals: Proposals) -> Float64:
        """(P, 4) of each proposal of a frame."""

    def may_be_object(self, probability: Float64, threshold: float) -> Bool:
        """(M,) rows of priors (M, 4) worth a classification: objects with at least this probability."""


class FrequencyPrior:
    """The frequency of the classes among proposals, the same for each: it excludes none.

    Args:
        frequency: (4,) frequencies of the classes.
    """

    pool_weight = 0.0

    def __init__(self, frequency: Float64) -> None:
        self.frequency = frequency

    def probability(self, proposals: Proposals) -> Float64:
        """(P, 4) equal rows."""
        return np.tile(self.frequency, (len(proposals), 1))

    def may_be_object(self, probability: Float64, threshold: float) -> Bool:
        """(M,) True."""
        return np.ones(len(probability), np.bool_)


class BoxPrior:
    """P(class | box, reflectance), under the class frequency (4,) that the scores assume."""

    def __init__(self, scores: BoxScores, frequency: Float64) -> None:
        self._scores, self.frequency = scores, frequency

    @property
    def pool_weight(self) -> float:
        """Weight of the box in the pool, of the proposals last given."""
        return self._scores.weights.box

    def probability(self, proposals: Proposals) -> Float64:
        """(P, 4) of each proposal of a frame."""
        boxes, reflectance = self._scores.of(proposals)
        return softmax(boxes + reflectance)

    def may_be_object(self, probability: Float64, threshold: float) -> Bool:
        """(M,) rows of priors (M, 4) that give the objects together at least this probability."""
        return 1.0 - probability[:, ObjectClass.BACKGROUND] >= threshold


def make_prior(scores: BoxScores, frequency: Float64) -> Prior:
    """BoxPrior; FrequencyPrior where the model has no box classifier."""
    return FrequencyPrior(frequency) if isinstance(scores.boxes, NoBoxClassifier) else BoxPrior(scores, frequency)
