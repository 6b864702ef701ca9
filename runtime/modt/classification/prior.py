"""What is thought of a proposal before its points are looked at: by what is common, or by its box and brightness.

A wall of twelve metres, a canopy, a pole: most background is known by its size. A few numbers a proposal tell it
apart for next to nothing, and the network need not be asked.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
from scipy.special import softmax

from modt.classification.crops import height_of
from modt.classification.layers import Layers, as_lists, logits, of_lists
from modt.classification.reflectance import Evidence
from modt.config import SensorConfig
from modt.types import Bool, Float64, Int, ObjectClass, Proposals

METADATA = "box_prior"
"""Key of an ONNX model's metadata under which the weights of its BoxPrior are found."""
N_FEATURES = 7
MOST_POINTS = 1000
"""What shows more points than this is large; how large, its box says."""
SMALL_M = 0.05
"""Added to lengths, so that those of thin things have logarithms that mean something."""


class Prior(Protocol):
    """P(class) of proposals that nobody has looked at."""

    def of(self, proposals: Proposals) -> Float64:
        """(P, 4) for each proposal of a frame."""
        ...

    def likely(self, said: Float64, least: float) -> Bool:
        """(M,) which may be objects, said (M, 4) being what it says of them: with this probability at least."""
        ...


class Frequency:
    """As common as the classes are among proposals, whatever the proposal: it rules nothing out.

    Args:
        objects: share of car, pedestrian and cyclist.
    """

    def __init__(self, objects: Sequence[float]) -> None:
        self._share = shares(objects)

    def of(self, proposals: Proposals) -> Float64:
        """(P, 4), the same for each."""
        return np.tile(self._share, (len(proposals), 1))

    def likely(self, said: Float64, least: float) -> Bool:
        """(M,) all of them: it does not tell them apart."""
        return np.ones(len(said), np.bool_)


def shares(objects: Sequence[float]) -> Float64:
    """(4,) of background, car, pedestrian and cyclist, the objects' being given."""
    return np.append(1.0 - np.sum(objects), objects)


class BoxPrior:
    """P(class | box, reflectance): a network of 1,444 weights over the size of a proposal and where it stands.

    Args:
        layers: of the network.
        sensor: its resolution, and how high it stands, for proposals that do not say.
        evidence: what the reflectance adds.
    """

    def __init__(self, layers: Layers, sensor: SensorConfig, evidence: Evidence) -> None:
        self._layers = layers
        self._sensor = sensor
        self._evidence = evidence

    def of(self, proposals: Proposals) -> Float64:
        """(P, 4) for each proposal of a frame."""
        feature = described(proposals, slice(None), self._sensor)
        score = logits(self._layers, feature) + self._evidence.of(feature, proposals.reflectance)
        probability: Float64 = softmax(score, axis=1)
        return probability

    def likely(self, said: Float64, least: float) -> Bool:
        """(M,) which are objects with this probability at least, said (M, 4) being what it says of them."""
        return at_least(said, least)


def at_least(said: Float64, least: float) -> Bool:
    """(M,) which rows (M, 4) give the objects together this probability."""
    likely: Bool = 1.0 - said[:, ObjectClass.BACKGROUND] >= least
    return likely


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


def encode(layers: Layers) -> str:
    """The layers as a model's metadata holds them."""
    return json.dumps(as_lists(layers))


def prior_of(
    metadata: Mapping[str, str], frequency: Sequence[float], sensor: SensorConfig, evidence: Evidence
) -> Prior:
    """The prior that a model brings along in its metadata; the frequency of the classes where it brings none.

    Args:
        metadata: of the model.
        frequency: share of car, pedestrian and cyclist.
        sensor: whose proposals are seen.
        evidence: what their reflectance adds.

    Raises:
        TypeError, ValueError: it brings one that cannot be used.
    """
    text = metadata.get(METADATA)
    if text is None:
        return Frequency(frequency)
    return BoxPrior(of_lists(json.loads(text), N_FEATURES), sensor, evidence)
