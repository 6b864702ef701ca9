"""How brightly proposals send light back, as evidence of what they are.

Number plates and lamps dazzle, car paint seen aslant sends nothing back, cloth and leaves lie in between: that says
what shape alone does not. It means something on the scale of the sensor that it was learnt from only. So a model
names that sensor, a profile its own; where the two differ, or a sweep carries no reflectance, shape decides alone.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping
from typing import Protocol

import numpy as np

from modt.classes import N_CLASSES
from modt.classification.mlp import Layers, as_lists, logits, of_lists, part_of
from modt.config import SensorConfig
from modt.types import N_REFLECTANCE, Float64

log = logging.getLogger(__name__)

METADATA = "reflectance"
"""Key of an ONNX model's metadata under which its evidence is found."""


class Evidence(Protocol):
    """What its returns say of a proposal beyond its box."""

    @property
    def share(self) -> float | None:
        """Of the box in the word of the network where there is evidence; None: as without."""
        ...

    @property
    def weight(self) -> float:
        """Share of it that the network, which knows the shape, does not know yet."""
        ...

    def of(self, box_features: Float64, reflectance: Float64 | None) -> Float64:
        """(R, 4) log likelihood of each class.

        Args:
            box_features: (R, 7) as prior.features tells them.
            reflectance: (R, 5) of the proposals, NaN where one has none; None where the sweep carries none.
        """
        ...


class NoEvidence:
    """Reflectance is not looked at."""

    share = None
    weight = 0.0

    def of(self, box_features: Float64, reflectance: Float64 | None) -> Float64:
        """(R, 4) zeros."""
        return np.zeros((len(box_features), N_CLASSES))


class Reflectance:
    """log P(reflectance | class, box), up to a constant: a network of 1,604 weights.

    Args:
        layers: of features of boxes and of reflectance, side by side.
        share, weight: see Evidence.
    """

    def __init__(self, layers: Layers, share: float, weight: float) -> None:
        self._layers = layers
        self.share = share
        self.weight = weight
        self._missed = False

    def of(self, box_features: Float64, reflectance: Float64 | None) -> Float64:
        """(R, 4) log likelihood of each class; zeros where there is no reflectance."""
        if reflectance is not None:
            told = logits(self._layers, np.hstack([box_features, reflectance]))
            told[np.isnan(reflectance[:, 0])] = 0.0
            return told
        if len(box_features) and not self._missed:
            log.warning(
                "a sweep carries no reflectance: shape alone decides, wherever that is so; have the sensor's driver "
                "write it, or set sensor.reflectance to none"
            )
            self._missed = True
        return np.zeros((len(box_features), N_CLASSES))


def encode(layers: Layers, share: float, weight: float, sensor: str) -> str:
    """The evidence as a model's metadata holds it."""
    return json.dumps({"sensor": sensor, "share": share, "weight": weight, "layers": as_lists(layers)})


def evidence_of(metadata: Mapping[str, str], n_box: int, sensor: SensorConfig) -> Evidence:
    """The evidence that a model brings along for a sensor; none where it brings none for this one.

    Args:
        metadata: of the model.
        n_box: features of a box.
        sensor: whose returns are seen.

    Raises:
        KeyError, TypeError, ValueError: it brings one that cannot be used.
    """
    text = metadata.get(METADATA)
    if text is None:
        return NoEvidence()
    held = json.loads(text)
    if held["sensor"] != sensor.reflectance:
        return NoEvidence()
    layers = of_lists(held["layers"], n_box + N_REFLECTANCE)
    return Reflectance(layers, part_of(held, "share"), part_of(held, "weight"))
