"""A PointNet pooled with the classifiers of box and reflectance (section III-B, sizes of section V-A)."""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np

from modt.classes import N_CLASSES, ObjectClass
from modt.classification import box_classifier, reflectance_classifier
from modt.classification.body import bodies, may_hold_more
from modt.classification.crops import Crops, batches, canonical, gather, ground_z_m
from modt.classification.network import Network
from modt.classification.pool import log_pool, softmax
from modt.classification.prior import BoxScores
from modt.classification.tuning import ClassificationTuning
from modt.config import ClassificationConfig, SensorConfig
from modt.errors import MisuseError
from modt.model_file import ModelFile
from modt.types import Float32, Float64, Int, Proposals

CLASS_FREQUENCY_KEY = "class_frequency"
"""Key of the class frequency in the metadata of a model: (C,), background first."""


class PointNet:
    """P(class | points, box, reflectance): log-linear pool of the network and the classifiers in its metadata.

    A proposal cut at the top or bottom within a person's height is classified by the network beside it,
    NAME-near.onnx, if there is one.

    The cost of a proposal follows its number of points: crops of similar size share a batch, so that padding is
    small, and a batch is small enough for its features to stay in the cache.

    Args:
        model: file of the network.
        config: size of batches and crops, and whether the network is pooled.
        sensor: for the height, where the proposals have none, and the scale of the reflectance.
        tuning: division into batches.

    Attributes:
        model: as given.
        network: the network alone.
        box_scores: classifiers of boxes, and of reflectance for this sensor.
        class_frequency: (C,) frequencies of the classes that the posteriors assume; a model that states none
            assumes that all are equal.

    Raises:
        MisuseError: not a plain ONNX model of (batch, points, 3) to (batch, C), more memory than
            `network.MEMORY_BYTES`, or malformed metadata; of the model or of that beside it.
    """

    def __init__(
        self,
        model: ModelFile,
        config: ClassificationConfig,
        sensor: SensorConfig,
        tuning: ClassificationTuning = ClassificationTuning(),
    ) -> None:
        self.model = model
        self.network = Network(model)
        self._config = config
        self._sensor = sensor
        self._tuning = tuning
        metadata = self.network.metadata
        pooled = metadata if config.likelihood == "pooled" else {}
        try:
            near = model.beside("-near") if pooled else None
            self._near = None if near is None else Network(near)
            boxes = box_classifier.from_metadata(pooled, self._near.metadata if self._near else None)
            reflectance = reflectance_classifier.from_metadata(pooled, sensor)
            self.box_scores = BoxScores(boxes, reflectance, sensor)
            self.class_frequency = _class_frequency(metadata)
            self._log_frequency = np.log(self.class_frequency)
        except (ArithmeticError, LookupError, TypeError, ValueError, RecursionError) as error:
            cause = f"malformed box or reflectance classifier ({error})"
            raise MisuseError(model.path, cause, "export the model again") from None
        self.network.check_largest(config.batch, config.max_points)

    def classify(self, points: Float32, proposals: Proposals, which: Int) -> Float64:
        """(R, C) class probabilities of the given proposals, in their order.

        Args:
            points: (N, 4) points of the frame; the proposals hold the coordinates of theirs.
            proposals: proposals of the frame.
            which: (R,) proposals to classify.
        """
        gathered = gather(proposals, which, self._config.max_points)
        ground = ground_z_m(proposals, which, self._sensor)
        crops = canonical(gathered, ground)
        probability = np.empty((len(crops), N_CLASSES))
        for network, rows in self._divided(proposals, which, crops.count.argsort(kind="stable")):
            self._infer(network, crops, rows, probability)
        if self.box_scores.informative:
            self._look_again(gathered, ground, proposals.box[which], probability)
        return self._pooled(probability, proposals, which)

    def _infer(self, network: Network, crops: Crops, rows: Int, probability: Float64) -> None:
        """Write the class probabilities of crops into their rows of (R, C); (K,) rows of ascending size."""
        for batch in batches(
            crops.count[rows].tolist(), self._config.batch, self._tuning.batching.max_padding_points
        ):
            probability[rows[batch]] = network.infer(crops.padded(rows[batch], self._config.min_points))

    def _look_again(self, crops: Crops, ground_z_m: Float64, box: Float64, probability: Float64) -> None:
        """Let the body of a person count where all points together are background.

        Args:
            crops: points of R proposals in the sensor frame.
            ground_z_m: (R,) z of the ground beneath each [m].
            box: (R, 7) boxes.
            probability: (R, C) of all points; of the body from here on, where that shows a person.
        """
        tuning = self._tuning.body
        may = may_hold_more(box, ground_z_m, tuning) & (probability[:, ObjectClass.BACKGROUND] > 0.5)
        if not may.any():
            return
        rows, found = bodies(crops, ground_z_m, may.nonzero()[0], tuning)
        of_body = np.empty((len(rows), N_CLASSES))
        found = canonical(found, ground_z_m[rows])
        self._infer(self.network, found, found.count.argsort(kind="stable"), of_body)
        is_person = of_body[:, ObjectClass.PEDESTRIAN] > tuning.min_person
        probability[rows[is_person]] = of_body[is_person]

    def _divided(self, proposals: Proposals, which: Int, crops: Int) -> list[tuple[Network, Int]]:
        """Each network with its part of the crops, in their order: (R,) indices into (R,) proposals."""
        if self._near is None:
            return [(self.network, crops)]
        near = self.box_scores.of(proposals).is_bound[which[crops]]
        return [(self.network, crops[~near]), (self._near, crops[near])]

    def _pooled(self, network: Float64, proposals: Proposals, which: Int) -> Float64:
        """(R, C) P(class | points, box, reflectance) of (R, C) P(class | points) and the scores of the proposals."""
        if not self.box_scores.informative:
            return network
        scores = self.box_scores.of(proposals)
        box = scores.box.take(which, axis=0)
        reflectance = scores.reflectance.take(which, axis=0)
        return softmax(log_pool(network, box, reflectance, self._log_frequency, scores.weights))

    def facts(self) -> dict[str, str]:
        """File and hash of the model, for the record of a run."""
        return {"file": self.model.path.name, "sha256": self.model.sha256}


def _class_frequency(metadata: Mapping[str, str]) -> Float64:
    """(C,) class frequency that a model states, each equal where it states none. Background gets what others leave.

    Raises:
        TypeError, ValueError: malformed.
    """
    text = metadata.get(CLASS_FREQUENCY_KEY)
    if text is None:
        return np.full(N_CLASSES, 1 / N_CLASSES)
    frequency = np.array([float(share) for share in json.loads(text)])
    if len(frequency) != N_CLASSES or not frequency.min() > 0 or not frequency[1:].sum() < 1:
        raise ValueError(f"class frequency {text}")
    return np.append(1.0 - frequency[1:].sum(), frequency[1:])
