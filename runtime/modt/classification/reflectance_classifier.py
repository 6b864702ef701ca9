"""Likelihood of a proposal's reflectance statistics under each class.

Number plates and lamps are bright, car paint at a grazing angle returns nothing, cloth and leaves lie between. The
values hold on the scale of one sensor, so a model has a classifier for each scale that it learnt, by its name. Where
the scale that `sensor.reflectance` of the profile names is not among them, or a sweep has no reflectance, every class
is as likely as any other.
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


class ReflectanceClassifier:
    """Multilayer perceptron over box features and reflectance statistics.

    Args:
        layers: layers of the perceptron.
        weights: weights in the pool of network, box and reflectance; also an attribute.
    """

    def __init__(self, layers: Layers, weights: PoolWeights) -> None:
        self.weights = weights
        self._layers = layers
        self._warned = False

    def log_likelihood(self, box_features: Float64, reflectance: Float64 | None) -> Float64:
        """(R, C) log P(reflectance | class, box) up to a constant a row.

        Args:
            box_features: (R, 7) features of the boxes.
            reflectance: (R, 5) statistics. The result is 0 where a proposal has none (NaN), or the sweep (None).
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


def from_metadata(metadata: Mapping[str, str], sensor: SensorConfig) -> ReflectanceClassifier | None:
    """Reflectance classifier of a model; None where its metadata has none of the sensor's scale.

    Raises:
        KeyError, TypeError, ValueError: malformed entry.
    """
    text = metadata.get(METADATA_KEY)
    if text is None:
        return None
    classifiers = {scale: _from_dict(content) for scale, content in dict(json.loads(text)).items()}
    if not classifiers or not classifiers.keys() <= set(REFLECTANCE_SCALES):
        raise ValueError(f"scales of reflectance {', '.join(classifiers) or 'none'}, not of {REFLECTANCE_SCALES}")
    return classifiers.get(sensor.reflectance)


def _from_dict(content: Mapping[str, Any]) -> ReflectanceClassifier:
    layers = from_lists(content["layers"], N_FEATURES + N_REFLECTANCE)
    return ReflectanceClassifier(layers, PoolWeights.from_dict(content["weights"]))
