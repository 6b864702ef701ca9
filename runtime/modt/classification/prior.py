"""Class prior of a proposal before the network sees its points: by class frequency, or by its box and reflectance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from modt.classes import N_CLASSES, ObjectClass
from modt.classification.box_classifier import BoxClassifier, is_bound, proposal_features
from modt.classification.pool import PoolWeights, softmax
from modt.classification.reflectance_classifier import ReflectanceClassifier
from modt.config import SensorConfig
from modt.types import Bool, Float64, Proposals


@dataclass(frozen=True)
class Scores:
    """Scores of the P proposals of a frame by box and reflectance.

    Attributes:
        box: (P, C) log P(class | box), up to a constant a row.
        reflectance: (P, C) log P(reflectance | class, box), up to a constant a row.
        is_bound: (P,) proposals cut at the top or bottom within a person's height, so the size is a lower bound.
        weights: weights in the pool with the network, which counts more where the sweep has no reflectance.
    """

    box: Float64
    reflectance: Float64
    is_bound: Bool
    weights: PoolWeights


class BoxScores:
    """The box classifier and the reflectance classifier of a model, side by side.

    The prior of the tracks and the pool of the classifier need the scores of the same proposals: those of the last
    frame are kept.

    Args:
        boxes: P(class | box), None if the model has none; also an attribute.
        reflectance: P(reflectance | class, box), None if the model has none for this sensor; also an attribute.
        sensor: spacing of its beams, and its height where the proposals have none.
    """

    def __init__(
        self, boxes: BoxClassifier | None, reflectance: ReflectanceClassifier | None, sensor: SensorConfig
    ) -> None:
        self.boxes = boxes
        self.reflectance = reflectance
        self._sensor = sensor
        self._beams = sensor.beams
        self._last: tuple[Proposals, Scores] | None = None

    @property
    def informative(self) -> bool:
        """Whether there is either classifier."""
        return self.boxes is not None or self.reflectance is not None

    def of(self, proposals: Proposals) -> Scores:
        """Scores of the proposals of a frame, worked out once as long as the frame is the same."""
        if self._last is None or self._last[0] is not proposals:
            self._last = (proposals, self._computed(proposals))
        return self._last[1]

    def _computed(self, proposals: Proposals) -> Scores:
        """Scores of the proposals; 0 of a classifier that the model has not."""
        features = proposal_features(proposals, self._sensor, self._beams)
        box = reflectance = np.zeros((len(proposals), N_CLASSES))
        weights = PoolWeights()
        if self.boxes is not None:
            box = self.boxes.log_probability(features, proposals.cut)
            weights = self.boxes.weights
        if self.reflectance is not None:
            reflectance = self.reflectance.log_likelihood(features, proposals.reflectance)
            weights = weights if proposals.reflectance is None else self.reflectance.weights
        return Scores(box, reflectance, is_bound(features, proposals.cut), weights)


class Prior(Protocol):
    """P(class) of proposals that are not classified yet."""

    frequency: Float64
    """(C,) frequency of the classes among proposals."""

    def pool_weight(self, proposals: Proposals) -> float:
        """Exponent of the prior's odds of an object in the classifier's pool (0 to 1)."""

    def probability(self, proposals: Proposals) -> Float64:
        """(P, C) prior of each proposal of a frame."""

    def may_be_object(self, probability: Float64, threshold: float) -> Bool:
        """(M,) rows of priors (M, C) worth a classification: the threshold or more for the objects together."""


class FrequencyPrior:
    """The frequency of the classes among proposals, the same for each: it excludes none.

    Args:
        frequency: (C,) frequencies of the classes; also an attribute.
    """

    def __init__(self, frequency: Float64) -> None:
        self.frequency = frequency

    def pool_weight(self, proposals: Proposals) -> float:
        """0: the pool has no box."""
        return 0.0

    def probability(self, proposals: Proposals) -> Float64:
        """(P, C) prior of each proposal of a frame, in equal rows."""
        return np.tile(self.frequency, (len(proposals), 1))

    def may_be_object(self, probability: Float64, threshold: float) -> Bool:
        """(M,) True for every row."""
        return np.ones(len(probability), np.bool_)


class BoxPrior:
    """P(class | box, reflectance) by the classifiers of a model.

    Args:
        scores: the classifiers.
        frequency: (C,) class frequency that they assume; also an attribute.
    """

    def __init__(self, scores: BoxScores, frequency: Float64) -> None:
        self.frequency = frequency
        self._scores = scores

    def pool_weight(self, proposals: Proposals) -> float:
        """Weight of the box in the pool."""
        return self._scores.of(proposals).weights.box

    def probability(self, proposals: Proposals) -> Float64:
        """(P, C) prior of each proposal of a frame."""
        scores = self._scores.of(proposals)
        return softmax(scores.box + scores.reflectance)

    def may_be_object(self, probability: Float64, threshold: float) -> Bool:
        """(M,) rows of priors (M, C) that give the objects together at least this probability."""
        return 1.0 - probability[:, ObjectClass.BACKGROUND] >= threshold


def make_prior(scores: BoxScores, frequency: Float64) -> Prior:
    """BoxPrior; FrequencyPrior where the model has no box classifier."""
    return FrequencyPrior(frequency) if scores.boxes is None else BoxPrior(scores, frequency)
