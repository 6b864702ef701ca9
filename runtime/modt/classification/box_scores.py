"""What box and reflectance say of the class of every proposal, worked out once a frame."""

from __future__ import annotations

import numpy as np

from modt.classes import N_CLASSES
from modt.classification.box_classifier import BoxClassifier, NoBoxClassifier, proposal_features
from modt.classification.pool import PoolWeights
from modt.classification.reflectance_classifier import NoReflectanceClassifier, ReflectanceClassifier
from modt.config import SensorConfig
from modt.types import Float64, Proposals


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
        self._proposals = Proposals.empty()
        self._scores = np.zeros((2, 0, N_CLASSES))

    @property
    def informative(self) -> bool:
        """Whether there is either classifier."""
        return not (isinstance(self.boxes, NoBoxClassifier) and isinstance(self.reflectance, NoReflectanceClassifier))

    @property
    def weights(self) -> PoolWeights:
        """In the pool with the network, of the proposals last given: without reflectance the network counts more."""
        told = None if self._proposals.reflectance is None else self.reflectance.weights
        return told or self.boxes.weights

    def of(self, proposals: Proposals) -> Float64:
        """(2, P, 4) log P(class | box) and log P(reflectance | class, box) of each proposal, up to constants."""
        if proposals is not self._proposals:
            features = proposal_features(proposals, self._sensor)
            boxes = self.boxes.log_probability(features)
            reflectance = self.reflectance.log_likelihood(features, proposals.reflectance)
            self._proposals, self._scores = proposals, np.stack([boxes, reflectance])
        return self._scores
