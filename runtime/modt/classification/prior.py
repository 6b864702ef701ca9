"""What is thought of a proposal before its points are looked at: by what is common, or by its box and brightness.

A few numbers a proposal tell most background apart for next to nothing, and the network need not be asked.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from scipy.special import softmax

from modt.classes import ObjectClass
from modt.classification.box_classifier import Boxes, NoBoxes, described
from modt.classification.reflectance_classifier import Evidence
from modt.config import SensorConfig
from modt.types import Bool, Float64, Proposals


class Prior(Protocol):
    """P(class) of proposals that nobody has looked at."""

    @property
    def share(self) -> float:
        """What part of it the word of the network holds already (0 to 1)."""
        ...

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

    share = 0.0

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
    """P(class | box, reflectance).

    Args:
        boxes: what they say.
        sensor: its resolution, and how high it stands, for proposals that do not say.
        evidence: what the reflectance adds.
    """

    def __init__(self, boxes: Boxes, sensor: SensorConfig, evidence: Evidence) -> None:
        self.share = share_of(boxes, evidence)
        self._boxes = boxes
        self._sensor = sensor
        self._evidence = evidence

    def of(self, proposals: Proposals) -> Float64:
        """(P, 4) for each proposal of a frame."""
        feature = described(proposals, slice(None), self._sensor)
        score = self._boxes.of(feature) + self._evidence.of(feature, proposals.reflectance)
        probability: Float64 = softmax(score, axis=1)
        return probability

    def likely(self, said: Float64, least: float) -> Bool:
        """(M,) which are objects with this probability at least, said (M, 4) being what it says of them."""
        return at_least(said, least)


def share_of(boxes: Boxes, evidence: Evidence) -> float:
    """Part of what boxes say in the word of a network, given the evidence besides."""
    return boxes.share if evidence.share is None else evidence.share


def at_least(said: Float64, least: float) -> Bool:
    """(M,) which rows (M, 4) give the objects together this probability."""
    likely: Bool = 1.0 - said[:, ObjectClass.BACKGROUND] >= least
    return likely


def prior_of(boxes: Boxes, frequency: Sequence[float], sensor: SensorConfig, evidence: Evidence) -> Prior:
    """The prior by what a model knows of boxes; the frequency of the classes where it knows nothing of them.

    Args:
        boxes: what they say.
        frequency: share of car, pedestrian and cyclist.
        sensor: whose proposals are seen.
        evidence: what their reflectance adds.
    """
    return Frequency(frequency) if isinstance(boxes, NoBoxes) else BoxPrior(boxes, sensor, evidence)
