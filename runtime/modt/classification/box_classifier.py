"""What the box of a proposal says of its class: a small network over its size and where it stands.

A wall of twelve metres, a canopy, a pole: most background is known by its size.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Protocol

import numpy as np

from modt.classes import N_CLASSES
from modt.classification.crops import height_of
from modt.classification.mlp import Layers, as_lists, logits, of_lists, part_of
from modt.config import SensorConfig
from modt.types import Float64, Int, Proposals

METADATA = "box_prior"
"""Key of an ONNX model's metadata under which what it knows of boxes is found."""
N_FEATURES = 7
MOST_POINTS = 1000
"""What shows more points than this is large; how large, its box says."""
SMALL_M = 0.05
"""Added to lengths, so that those of thin things have logarithms that mean something."""


class Boxes(Protocol):
    """What boxes say."""

    @property
    def share(self) -> float:
        """Of the box in the word of the network, which sees the points, where no evidence helps (0 to 1)."""
        ...

    def of(self, feature: Float64) -> Float64:
        """(R, 4) log probability of each class, up to a constant, by features (R, 7) as features() tells them."""
        ...


class NoBoxes:
    """Boxes say nothing."""

    share = 0.0

    def of(self, feature: Float64) -> Float64:
        """(R, 4) zeros."""
        return np.zeros((len(feature), N_CLASSES))


class KnownBoxes:
    """log P(class | box), up to a constant: a network of 1,444 weights.

    Args:
        layers: of features of boxes.
        share: see Boxes.
    """

    def __init__(self, layers: Layers, share: float) -> None:
        self._layers = layers
        self.share = share

    def of(self, feature: Float64) -> Float64:
        """(R, 4) log probability of each class, up to a constant."""
        return logits(self._layers, feature)


def beam_sr(azimuth_step_deg: float, elevation_step_deg: float) -> float:
    """Solid angle between neighbouring beams [sr]."""
    return float(np.deg2rad(azimuth_step_deg) * np.deg2rad(elevation_step_deg))


def features(count: Int, box: Float64, sensor_height_m: float, step_sr: float) -> Float64:
    """(P, 7) what is known of proposals without their points.

    The points count by the area that they cover, so that sensors of different resolution see alike: logarithms of
    that area [m2], of the distance, the length and the width [m]; height, foot and top above the ground [m].

    Args:
        count: (P,) points.
        box: (P, 7) sensor frame.
        sensor_height_m: of the sensor above the ground.
        step_sr: solid angle that a point stands for [sr].
    """
    distance = np.maximum(np.hypot(box[:, 0], box[:, 1]), 1.0)
    foot = box[:, 2] - box[:, 5] / 2 + sensor_height_m
    return np.stack(
        [
            np.log(np.clip(count, 1, MOST_POINTS) * distance**2 * step_sr),
            np.log(distance),
            np.log(box[:, 3] + SMALL_M),
            np.log(box[:, 4] + SMALL_M),
            box[:, 5],
            foot,
            foot + box[:, 5],
        ],
        axis=1,
    )


def described(proposals: Proposals, which: Int | slice, sensor: SensorConfig) -> Float64:
    """(R, 7) features of the proposals given, as the sensor shows them."""
    step_sr = beam_sr(sensor.azimuth_step_deg, sensor.elevation_step_deg)
    return features(proposals.count[which], proposals.box[which], height_of(proposals, sensor), step_sr)


def encode(layers: Layers, share: float) -> str:
    """What is known of boxes as a model's metadata holds it."""
    return json.dumps({"share": share, "layers": as_lists(layers)})


def boxes_of(metadata: Mapping[str, str]) -> Boxes:
    """What a model brings along about boxes; nothing where it brings nothing.

    Raises:
        KeyError, TypeError, ValueError: it brings something that cannot be used.
    """
    text = metadata.get(METADATA)
    if text is None:
        return NoBoxes()
    held = json.loads(text)
    return KnownBoxes(of_lists(held["layers"], N_FEATURES), part_of(held, "share"))
