"""Classification of a proposal by its box and its number of points.

Most background differs from every object in size: walls, canopies, poles.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from modt.classes import N_CLASSES
from modt.classification.crops import ground_z_m
from modt.classification.mlp import Layers, from_lists, logits, to_lists
from modt.classification.pool import PoolWeights
from modt.config import SensorConfig
from modt.types import Float64, Int, Proposals

METADATA_KEY = "box_prior"
"""Key of the box classifier in the metadata of an ONNX model."""
N_FEATURES = 7
# Definition of the features: fixed when a model is trained.
_MAX_COUNT = 1000
_LENGTH_OFFSET_M = 0.05  # keeps the logarithm of a length finite


class NoBoxClassifier:
    """No information from boxes."""

    weights = PoolWeights()

    def log_probability(self, features: Float64) -> Float64:
        """(R, 4) zeros."""
        return np.zeros((len(features), N_CLASSES))


@dataclass(frozen=True, slots=True)
class MlpBoxClassifier:
    """Multilayer perceptron of 1,444 weights."""

    layers: Layers
    weights: PoolWeights  # in the pool with the network, without reflectance

    def log_probability(self, features: Float64) -> Float64:
        """(R, 4) log P(class | box) up to a constant, of (R, 7) `box_features`."""
        return logits(self.layers, features)


BoxClassifier = NoBoxClassifier | MlpBoxClassifier


def beam_solid_angle_sr(sensor: SensorConfig, box: Float64) -> Float64:
    """(P,) or () solid angle between neighbouring beams at (P, 7) boxes, sensor frame [sr]."""
    tangent = box[:, 2] / np.maximum(np.hypot(box[:, 0], box[:, 1]), 1.0)
    elevation_step_rad = sensor.beams.step_rad(tangent.astype(np.float32))
    return np.asarray(np.deg2rad(sensor.azimuth_step_deg) * elevation_step_rad, np.float64)


def box_features(count: Int, box: Float64, ground_z_m: Float64, beam_sr: Float64) -> Float64:
    """(P, 7) logarithms of the area covered by points [m2], distance, length and width [m]; height, foot and top [m].

    The area in place of the number of points makes the features independent of the sensor's resolution.

    Args:
        count: (P,) points.
        box: (P, 7) sensor frame.
        ground_z_m: (P,) of the ground beneath each, sensor frame.
        beam_sr: (P,) or () solid angle of a point [sr].
    """
    x, y, z, length, width, height, _ = box.T
    features = np.empty((N_FEATURES, len(box)))
    area, distance, *_, foot, top = features
    np.maximum(np.hypot(x, y), 1.0, out=distance)
    np.multiply(np.minimum(np.maximum(count, 1), _MAX_COUNT), distance**2 * beam_sr, out=area)
    features[2:5] = length + _LENGTH_OFFSET_M, width + _LENGTH_OFFSET_M, height
    np.log(features[:4], out=features[:4])
    foot[:] = z - height / 2 - ground_z_m
    np.add(foot, height, out=top)
    return features.T


def proposal_features(proposals: Proposals, sensor: SensorConfig) -> Float64:
    """(P, 7) box features of the proposals."""
    beam_sr = beam_solid_angle_sr(sensor, proposals.box)
    return box_features(proposals.count, proposals.box, ground_z_m(proposals, slice(None), sensor), beam_sr)


def to_metadata(layers: Layers, weights: PoolWeights) -> str:
    """Metadata entry of a box classifier."""
    return json.dumps({"weights": weights.as_dict(), "layers": to_lists(layers)})


def from_metadata(metadata: Mapping[str, str]) -> BoxClassifier:
    """Box classifier of a model; NoBoxClassifier where its metadata has none.

    Raises:
        KeyError, TypeError, ValueError: malformed entry.
    """
    text = metadata.get(METADATA_KEY)
    if text is None:
        return NoBoxClassifier()
    content = json.loads(text)
    return MlpBoxClassifier(from_lists(content["layers"], N_FEATURES), PoolWeights.from_dict(content["weights"]))
