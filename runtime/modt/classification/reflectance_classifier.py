"""Likelihood of a proposal's reflectance statistics under each class.

Number plates and lamps are bright, car paint at a grazing angle returns nothing, cloth and leaves lie between. The
values hold on the scale of one sensor: a model has a classifier for each scale that it learnt, by its name. Where the
scale that `sensor.reflectance` of the profile names is not among them, or a sweep has no reflectance, none adds
anything.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping
from typing import Any

import numpy as np

from modt.classes import N_CLASSES
from modt.classification.box_classifier import N_FEATURES, Layers, from_lists, logits
from modt.classification.pool import PoolWeights
from modt.config import REFLECTANCE_SCALES, SensorConfig
from modt.types import N_REFLECTANCE, Float64

log = logging.getLogger(__name__)

METADATA_KEY = "reflectance"
"""Key of the reflectance classifiers in the metadata of an ONNX model."""


class NoReflectanceClassifier:
    """No information from reflectance."""

    weights = None

    def log_likelihood(self, box_features: Float64, reflectance: Float64 | None) -> Float64:
        """(R, 4) zeros."""
        return np.zeros((len(box_features), N_CLASSES))


class MlpReflectanceClassifier:
    """Multilayer perceptron of 1,604 weights over box features and reflectance statistics, side by side.

    Args:
        layers: layers of the network.
        weights: in the pool of network, box and reflectance.
    """

    def __init__(self, layers: Layers, weights: PoolWeights) -> None:
        self._layers, self.weights = layers, weights
        self._warned = False

    def log_likelihood(self, box_features: Float64, reflectance: Float64 | None) -> Float64:
        """(R, 4) log P(reflectance | class, box) up to a constant, of (R, 7) `box_features` and (R, 5) statistics.

        Zeros where a proposal has no reflectance (NaN) or the sweep has none (None).
        """
        if reflectance is not None:
            likelihood = logits(self._layers, np.concatenate((box_features, reflectance), axis=1))
            likelihood[np.isnan(reflectance[:, 0])] = 0.0
            return likelihood
        if len(box_features) and not self._warned:
            log.warning(
                "a sweep has no reflectance: such sweeps are classified by shape alone; enable reflectance in the "
                "sensor's driver, or set sensor.reflectance to none"
            )
            self._warned = True
        return np.zeros((len(box_features), N_CLASSES))


ReflectanceClassifier = NoReflectanceClassifier | MlpReflectanceClassifier


def from_metadata(metadata: Mapping[str, str], sensor: SensorConfig) -> ReflectanceClassifier:
    """Reflectance classifier of a model; NoReflectanceClassifier where its metadata has none of this scale.

    Raises:
        KeyError, TypeError, ValueError: malformed entry.
    """
    text = metadata.get(METADATA_KEY)
    if text is None:
        return NoReflectanceClassifier()
    classifiers = {scale: _from_dict(content) for scale, content in dict(json.loads(text)).items()}
    if not classifiers or not classifiers.keys() <= set(REFLECTANCE_SCALES):
        raise ValueError(f"scales of reflectance {', '.join(classifiers) or 'none'}, not of {REFLECTANCE_SCALES}")
    return classifiers.get(sensor.reflectance, NoReflectanceClassifier())


def _from_dict(content: Mapping[str, Any]) -> MlpReflectanceClassifier:
    layers = from_lists(content["layers"], N_FEATURES + N_REFLECTANCE)
    return MlpReflectanceClassifier(layers, PoolWeights.from_dict(content["weights"]))
