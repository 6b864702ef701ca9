"""Classification of a proposal by its box and its number of points.

Most background differs from every object in size: walls, canopies, poles.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modt.classes import N_CLASSES
from modt.classification.crops import ground_z_m
from modt.classification.pool import PoolWeights
from modt.config import SensorConfig
from modt.geometry.beams import Beams
from modt.types import Bool, Cut, Float64, Int, Proposals

Weights = NDArray[np.floating[Any]]
Layers = Sequence[tuple[Weights, Weights]]
"""(in, out) weight and (out,) bias of each layer."""


def logits(layers: Layers, features: Float64) -> Float64:
    """(R, C) outputs of a multilayer perceptron for (R, F) features, in the precision of its layers."""
    *hidden, (weight, bias) = layers
    value: Weights = features.astype(weight.dtype)
    for hidden_weight, hidden_bias in hidden:
        value = value @ hidden_weight
        np.tanh(np.add(value, hidden_bias, out=value), out=value)
    return (value @ weight + bias).astype(np.float64)


def from_lists(lists: Any, n_features: int) -> Layers:
    """Layers from JSON, in single precision: half the time of double.

    Raises:
        TypeError, ValueError: not layers, not finite, or not from n_features inputs to the classes.
    """
    with np.errstate(over="ignore"):
        layers = [(np.array(weight, np.float32), np.array(bias, np.float32)) for weight, bias in lists]
    if not all(np.isfinite(weight).all() and np.isfinite(bias).all() for weight, bias in layers):
        raise ValueError("weights that are not finite")
    widths = [n_features, *(len(bias) for _, bias in layers)]
    if widths[-1] != N_CLASSES or [weight.shape for weight, _ in layers] != [*pairwise(widths)]:
        raise ValueError(f"layers of {' x '.join(map(str, widths))}, wanted {n_features} to {N_CLASSES}")
    return layers


METADATA_KEY = "box_prior"
"""Key of the box classifier in the metadata of an ONNX model."""
BOUNDS_KEY = "box_bounds"
"""Key of the classifier of cut boxes, in the metadata of the model beside it that judges what the view cuts."""
# Definition of the features: fixed when a model is trained.
N_FEATURES = 7
"""Number of features of a box."""
BOUND_FLAGS = Cut.TOP, Cut.BOTTOM, Cut.SIDE
"""Sides whose cut is a feature. The nearest range is a choice of the profile and says nothing of the object."""
N_BOUND_FEATURES = N_FEATURES + len(BOUND_FLAGS)
"""Number of features of a cut box."""
PERSON_TOP_M = 2.0
"""Height above ground below which the view may have cut off a person's upper part [m]."""
LEGS_M = 0.4
"""Height above ground above which the view may have cut off a person's legs [m]."""
_MAX_COUNT = 1000
"""Points that count for the area at most."""
_LENGTH_OFFSET_M = 0.05
"""Offset that keeps the logarithm of a length finite [m]."""


@dataclass(frozen=True)
class BoxClassifier:
    """Multilayer perceptron, and one for cut boxes, whose sizes are lower bounds.

    Attributes:
        layers: layers of the perceptron.
        weights: weights in the pool with the network, without reflectance.
        bounds: layers of the perceptron for cut boxes; without it they are classified as the others.
    """

    layers: Layers
    weights: PoolWeights
    bounds: Layers | None = None

    def log_probability(self, features: Float64, cut: Int) -> Float64:
        """(R, C) log P(class | box) up to a constant a row, of (R, 7) `box_features` and (R,) flags of Cut."""
        out = logits(self.layers, features)
        if self.bounds is not None and len(rows := is_bound(features, cut).nonzero()[0]):
            out[rows] = logits(self.bounds, bound_features(features[rows], cut[rows]))
        return out


def box_features(count: Int, box: Float64, ground_z_m: Float64, beam_sr: Float64) -> Float64:
    """Features of boxes (P, 7).

    They are the logarithms of the area covered by points [m2], of distance, length and width [m], then height, foot
    and top above ground [m]. The area in place of the number of points makes them independent of the sensor's
    resolution.

    Args:
        count: (P,) points.
        box: (P, 7) boxes in the sensor frame.
        ground_z_m: (P,) z of the ground beneath each [m, sensor frame].
        beam_sr: (P,) or () solid angle of a point [sr].
    """
    x, y, z, length, width, height, _ = box.T
    features = np.empty((N_FEATURES, len(box)))
    area, distance, *_, foot, top = features  # views: what is written into them is a feature
    np.maximum(np.hypot(x, y), 1.0, out=distance)
    np.multiply(np.minimum(np.maximum(count, 1), _MAX_COUNT), distance**2 * beam_sr, out=area)
    np.add((length, width), _LENGTH_OFFSET_M, out=features[2:4])
    np.log(features[:4], out=features[:4])
    features[4] = height
    foot[:] = z - height / 2 - ground_z_m
    np.add(foot, height, out=top)
    return features.T


def is_bound(features: Float64, cut: Int) -> Bool:
    """(R,) boxes cut at the top or bottom within a person's height, so the size is a lower bound.

    Args:
        features: (R, 7) features of the boxes.
        cut: (R,) flags of Cut.
    """
    if not (cut & (Cut.TOP | Cut.BOTTOM).value).any():  # most frames
        return np.zeros(len(cut), np.bool_)
    *_, foot_m, top_m = features.T
    is_bound: Bool = ((cut & Cut.TOP) > 0) & (top_m < PERSON_TOP_M)
    is_bound |= ((cut & Cut.BOTTOM) > 0) & (foot_m > LEGS_M)
    return is_bound


def bound_features(features: Float64, cut: Int) -> Float64:
    """(R, 10) features of cut boxes: (R, 7) features of boxes, and each of BOUND_FLAGS in (R,) flags of Cut."""
    return np.column_stack([features, *((cut & side) > 0 for side in BOUND_FLAGS)])


def proposal_features(proposals: Proposals, sensor: SensorConfig, beams: Beams | None = None) -> Float64:
    """(P, 7) features of the boxes of proposals.

    Args:
        proposals: proposals of a frame.
        sensor: azimuth step, and the height where the proposals have no ground.
        beams: beams of the sensor, if at hand: looking them up in `sensor` takes time.
    """
    beam_sr = proposals.beam_sr
    if beam_sr is None:
        beam_sr = solid_angles(proposals.box, sensor, beams)
    return box_features(proposals.count, proposals.box, ground_z_m(proposals, slice(None), sensor), beam_sr)


def solid_angles(box: Float64, sensor: SensorConfig, beams: Beams | None = None) -> Float64:
    """(P,) solid angle of a point [sr] of boxes (P, 7) in the frame of a sensor; `beams` as in proposal_features."""
    tangent = box[:, 2] / np.maximum(np.hypot(box[:, 0], box[:, 1]), 1.0)
    elevation_step_rad = (beams or sensor.beams).step_rad(tangent.astype(np.float32))
    return np.asarray(np.deg2rad(sensor.azimuth_step_deg) * elevation_step_rad, np.float64)


def from_metadata(metadata: Mapping[str, str], beside: Mapping[str, str] | None = None) -> BoxClassifier | None:
    """Box classifier of a model; None where its metadata has none.

    Args:
        metadata: metadata of the model.
        beside: metadata of the model beside it, with the classifier of cut boxes.

    Raises:
        KeyError, TypeError, ValueError: malformed entry.
    """
    text = metadata.get(METADATA_KEY)
    if text is None:
        return None
    content = json.loads(text)
    bounds = from_lists(json.loads(beside[BOUNDS_KEY]), N_BOUND_FEATURES) if beside else None
    layers = from_lists(content["layers"], N_FEATURES)
    return BoxClassifier(layers, PoolWeights.from_dict(content["weights"]), bounds)
