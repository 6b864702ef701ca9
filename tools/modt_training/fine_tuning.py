"""Further training of an exported model: new crops are learnt, and others keep the posterior that it gives them.

A model of fewer classes than the table gets outputs for the further ones. The loss has a part for each kind of crops:
new ones are learnt by their labels, kept ones by the posterior that the model gave them, streets by their labels. The
class frequencies that the posteriors assume hold on the kept ones. A crop may be in more than one part.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from numpy.random import Generator
from onnx import helper, numpy_helper
from scipy.optimize import minimize
from scipy.special import log_softmax, softmax
from torch import Tensor, nn

from modt.classes import CLASS_NAMES, N_CLASSES, N_SHIPPED
from modt.classification import box_classifier, reflectance_classifier
from modt.classification.box_classifier import BoxClassifier, Layers, Weights
from modt.classification.crops import Crops, canonical
from modt.classification.network import CLASSES_KEY
from modt.classification.pointnet import CLASS_FREQUENCY_KEY
from modt.classification.pool import log_pool
from modt.errors import MisuseError
from modt.model_file import REMEDY
from modt.types import Float64, Int
from modt_training.augment import augment, distance_m, subsample
from modt_training.dataset import (
    BATCH_SIZE,
    SYNTHETIC,
    Dataset,
    Sensors,
    dataset_features,
    draw_batch,
    sampling_pools,
)
from modt_training.export_pointnet import N_SHARED, Layer, classifier_entry, graph, to_lists
from modt_training.held_out import Calibration
from modt_training.network import MaxPooledLinear

POINTS = 128
"""Maximum number of points of a crop in a batch."""


MAX_POINTS = 400
"""Maximum number of points of a crop before augmentation."""


def tensors(crops: Crops, sensors: Sensors) -> tuple[torch.Tensor, torch.Tensor]:
    """Input of the network: (K, 3) canonical points, crop after crop, and (R,) points of each crop."""
    local = canonical(crops, sensors.ground_z_m)
    return torch.from_numpy(local.xyz), torch.from_numpy(local.count)


class Student(nn.Module):
    """The exported network, its normalisation folded in."""

    def __init__(self, layers: list[Layer]) -> None:
        super().__init__()
        self.weight = nn.ParameterList(torch.from_numpy(w.T.astype(np.float32)) for w, _ in layers)
        self.bias = nn.ParameterList(torch.from_numpy(b.astype(np.float32)) for _, b in layers)

    def forward(self, xyz: Tensor, count: Tensor) -> Tensor:
        """(R, C) logits of R crops: (K, 3) concatenated points, (R,) points of each crop."""
        h = xyz
        for i, (weight, bias) in enumerate(zip(self.weight, self.bias, strict=True)):
            product = MaxPooledLinear.apply(h, weight, count) if i == N_SHARED - 1 else h @ weight.T
            h = product + bias
            h = torch.relu(h) if i < len(self.weight) - 1 else h
        return h

    def layers(self) -> list[Layer]:
        """(in, out) weight and (out,) bias of each layer."""
        pairs = zip(self.weight, self.bias, strict=True)
        return [(w.detach().numpy().T.copy(), b.detach().numpy().copy()) for w, b in pairs]


def layers_of(model: onnx.ModelProto) -> list[Layer]:
    """(in, out) weight and (out,) bias of each layer of an exported network."""
    array = {i.name: numpy_helper.to_array(i) for i in model.graph.initializer}
    weights = [array[f"weight{i}"] for i in range(len(array) // 2)]
    return [(w.T if i < N_SHARED else w, array[f"bias{i}"].ravel()) for i, w in enumerate(weights)]


KEPT_BATCHES = 800
"""Batches of crops that keep their posterior, half of them augmented; augmentation costs more than a step."""
TRAINED_SHARE = 0.82
"""Weight of the trained parameters in the mean with those before, which know streets better."""
STREET_SIZE = 96
"""Number of crops of simulated streets of a step, as frequent as they are met."""
BOX_STREET_SIZE = 192
"""Number of crops of simulated streets of a step of the box classifier."""
RATE = 4e-4
"""Greatest learning rate of the network."""
BOX_CROPS = 40_000
"""Crops of each kind for the box classifier."""
BOX_SIZE = 512
"""Number of crops of a step of the box classifier that keep their posterior."""
BOX_STEPS = 4
"""Steps of the box classifier for each one of the network; they are cheap."""
BOX_RATE = 6e-3
"""Greatest learning rate of the box classifier."""
MIN_PROBABILITY = 1e-12
"""Floor that keeps logarithms finite."""
RARE = 1e-4
"""Probability of a class of the user's own, before anything is known of it, relative to that of background."""


@dataclass(frozen=True)
class Examples:
    """Crops, augmented or not, and the posteriors to learn.

    Attributes:
        local: R crops in the canonical frame.
        wanted: (R, C) posteriors that the network is to give.
        size: number of them in a step.
        shift: (C,) addend of the logits, by which the share of each class among the crops differs from its frequency.
    """

    local: Crops
    wanted: Float64
    size: int
    shift: Float64

    def input(self, rows: Int) -> tuple[Tensor, Tensor]:
        """Input of the network: (K, 3) points, crop after crop, and (R,) points of each crop."""
        crops = take(self.local, rows)
        return torch.from_numpy(crops.xyz), torch.from_numpy(crops.count)


def extended(layers: Sequence[Layer], log_share: float) -> list[Layer]:
    """Layers with an output for each class; further ones are that of background plus `log_share`."""
    *hidden, (weight, bias) = layers
    more = N_CLASSES - len(bias)
    weight = np.hstack([weight, np.repeat(weight[:, :1], more, axis=1)])
    return [*hidden, (weight, np.append(bias, np.full(more, bias[0] + log_share)).astype(bias.dtype))]


def _extended_lists(lists: list[list[Any]], log_share: float) -> list[list[Any]]:
    """The same for layers as JSON holds them."""
    return to_lists(extended([(np.array(w), np.array(b)) for w, b in lists], log_share))


def extended_metadata(metadata: Mapping[str, str]) -> dict[str, str]:
    """Metadata of a model, or of that beside it, with an output for each class in its classifiers.

    The reflectance tells nothing of a further class against background.
    """
    found = dict(metadata)
    if text := metadata.get(CLASS_FREQUENCY_KEY):
        frequency = json.loads(text)
        frequency = np.append(frequency, np.full(N_CLASSES - len(frequency), RARE * frequency[0]))
        found[CLASS_FREQUENCY_KEY] = json.dumps((frequency / frequency.sum()).tolist())
    if text := metadata.get(box_classifier.METADATA_KEY):
        entry = json.loads(text)
        entry["layers"] = _extended_lists(entry["layers"], math.log(RARE))
        found[box_classifier.METADATA_KEY] = json.dumps(entry)
    if text := metadata.get(reflectance_classifier.METADATA_KEY):
        entries = json.loads(text)
        for entry in entries.values():
            entry["layers"] = _extended_lists(entry["layers"], 0.0)
        found[reflectance_classifier.METADATA_KEY] = json.dumps(entries)
    if text := metadata.get(box_classifier.BOUNDS_KEY):
        found[box_classifier.BOUNDS_KEY] = json.dumps(_extended_lists(json.loads(text), math.log(RARE)))
    if N_SHIPPED < N_CLASSES:
        found[CLASSES_KEY] = ",".join(CLASS_NAMES)
    return found


class BoxStudent(nn.Module):
    """The box classifier, from its calibrated layers on."""

    def __init__(self, layers: Layers) -> None:
        super().__init__()
        self.weight = nn.ParameterList(torch.from_numpy(np.array(w, np.float32)) for w, _ in layers)
        self.bias = nn.ParameterList(torch.from_numpy(np.array(b, np.float32)) for _, b in layers)

    def forward(self, feature: Tensor) -> Tensor:
        """(R, C) logits of (R, 7) features."""
        value = feature
        for i, (weight, bias) in enumerate(zip(self.weight, self.bias, strict=True)):
            value = value @ weight + bias
            value = torch.tanh(value) if i < len(self.weight) - 1 else value
        return value

    def layers(self) -> Layers:
        """(in, out) weight and (out,) bias of each layer."""
        return [(w.detach().numpy(), b.detach().numpy()) for w, b in zip(self.weight, self.bias, strict=True)]


@dataclass(frozen=True)
class Model:
    """Scores that decide the posterior of a proposal of unknown reflectance.

    Attributes:
        network: the network.
        boxes: the box classifier.
        log_frequency: (C,) log of the class frequencies that both assume.
        metadata: texts of the model by their keys.
    """

    network: Student
    boxes: BoxClassifier
    log_frequency: Float64
    metadata: Mapping[str, str]

    @classmethod
    def of(cls, model: onnx.ModelProto) -> Model:
        """Read the parts of an exported model, with an output for each class.

        Raises:
            MisuseError: it has no box classifier, or says no class frequencies.
        """
        metadata = extended_metadata({entry.key: entry.value for entry in model.metadata_props})
        boxes = box_classifier.from_metadata(metadata)
        if boxes is None or CLASS_FREQUENCY_KEY not in metadata:
            raise MisuseError("model", "has no box classifier, or says no class frequencies", REMEDY)
        network = Student(extended(layers_of(model), math.log(RARE)))
        return cls(network, boxes, np.log(json.loads(metadata[CLASS_FREQUENCY_KEY])), metadata)

    @torch.no_grad()
    def network_posterior(self, local: Crops) -> Float64:
        """(R, C) posteriors by the network, of R crops in the canonical frame."""
        logits = []
        for first in range(0, len(local), 500):
            part = slice(first, min(first + 500, len(local)))
            xyz = local.xyz[local.offsets[part.start] : local.offsets[part.stop]]
            logits.append(self.network(torch.from_numpy(xyz), torch.from_numpy(local.count[part])).double().numpy())
        return np.asarray(softmax(np.concatenate(logits), axis=1), np.float64)

    def posterior_of_points(self, data: Dataset, rows: Int) -> Float64:
        """(R, C) posteriors by the network, of rows of a data set, without augmentation."""
        crops = subsample(data.take(rows), POINTS, np.random.default_rng(0))
        return self.network_posterior(canonical(crops, data.sensors.ground_z_m[rows]))

    def posterior(self, data: Dataset) -> Float64:
        """(R, C) posteriors by network and box together, of the crops of a data set, without augmentation."""
        rows = np.arange(len(data))
        network = self.posterior_of_points(data, rows)
        log_box = box_classifier.logits(self.boxes.layers, dataset_features(data, rows))
        none = np.zeros_like(log_box)
        pool = log_pool(network, log_box, none, self.log_frequency, self.boxes.weights)
        return np.asarray(softmax(pool, axis=1), np.float64)


def augmented(data: Dataset, drawn: Iterable[Int], rng: Generator) -> tuple[Crops, Float64, Int]:
    """Augmented crops of batches of rows, in the canonical frame; (R,) distance [m] and row of each."""
    parts = []
    distance = []
    drawn_rows = []
    for rows in drawn:
        crops, sensors = augment(subsample(data.take(rows), MAX_POINTS, rng), data.sensors.take(rows), rng)
        parts.append(canonical(subsample(crops, POINTS, rng), sensors.ground_z_m))
        distance.append(distance_m(crops))
        drawn_rows.append(rows)
    return joined(parts), np.concatenate(distance), np.concatenate(drawn_rows)


def unchanged(data: Dataset, drawn: Iterable[Int], rng: Generator) -> tuple[Crops, Int]:
    """Crops of batches of rows without augmentation, in the canonical frame, and (R,) row of each."""
    rows = np.concatenate(list(drawn))
    return canonical(subsample(data.take(rows), POINTS, rng), data.sensors.ground_z_m[rows]), rows


def joined(parts: Sequence[Crops]) -> Crops:
    """Crops of all parts, in order."""
    count = np.concatenate([part.count for part in parts])
    return Crops(np.concatenate([part.xyz for part in parts]), np.append(0, np.cumsum(count)))


def kept_examples(model: Model, data: Dataset, rng: Generator, batches: int = KEPT_BATCHES) -> Examples:
    """Crops of the data of the model, each with the posterior that the network gives it, whole objects or not."""
    pools = [sampling_pools(data, rows) for rows in _all_and_simulated(data)]
    drawn = [draw_batch(pool, rng) for pool in pools for _ in range(batches // 2)]
    local = joined([augmented(data, drawn[::2], rng)[0], unchanged(data, drawn[1::2], rng)[0]])
    return Examples(local, model.network_posterior(local), BATCH_SIZE, np.zeros(N_CLASSES))


def one_hot(label: Int) -> Float64:
    """(R, C) certain posteriors of classes (R,)."""
    return np.eye(N_CLASSES)[label]


def take(crops: Crops, rows: Int) -> Crops:
    """Crops of rows (R,)."""
    offsets = np.append(0, np.cumsum(crops.count[rows]))
    index = np.repeat(crops.offsets[rows] - offsets[:-1], crops.count[rows]) + np.arange(offsets[-1])
    return Crops(crops.xyz[index], offsets)


def train_network(
    model: Model,
    kept: Examples,
    others: Sequence[Examples],
    steps: int,
    seed: int,
    progress: Callable[[str], None] = lambda words: None,
) -> Model:
    """The model after training of its network on other crops, and on its own posteriors for those that are kept.

    The parameters are averaged with those before by TRAINED_SHARE, then calibrated to the posteriors that are kept.
    `progress` is called after every step.
    """
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    network = Student(model.network.layers())
    optimiser = torch.optim.AdamW(network.parameters(), weight_decay=1e-4)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, RATE, total_steps=steps, pct_start=max(0.1, 2 / steps))
    parts = (kept, *others)
    for _ in range(steps):
        loss = torch.zeros(())
        for examples in parts:
            rows = rng.integers(0, len(examples.wanted), examples.size)
            target = torch.from_numpy(examples.wanted[rows].astype(np.float32))
            logits = network(*examples.input(rows)) + torch.from_numpy(examples.shift.astype(np.float32))
            loss = loss + nn.functional.cross_entropy(logits, target, reduction="sum")
        optimiser.zero_grad()
        (loss / sum(examples.size for examples in parts)).backward()
        optimiser.step()
        schedule.step()
        progress("")
    both = zip(model.network.layers(), network.layers(), strict=True)
    layers = [
        (_between(weight, new_weight), _between(bias, new_bias)) for (weight, bias), (new_weight, new_bias) in both
    ]
    trained = replace(model, network=Student(layers))
    logits = np.log(trained.network_posterior(kept.local).clip(MIN_PROBABILITY))
    calibration = keep_posteriors(logits, kept.wanted, np.full(len(logits), 1 / len(logits)))
    return replace(model, network=Student(list(calibration.fold_into(layers))))


def _between(before: Weights, after: Weights) -> Weights:
    """Weights between those before and after the training."""
    return (1.0 - TRAINED_SHARE) * before + TRAINED_SHARE * after


@dataclass(frozen=True)
class Boxes:
    """Features of boxes, and the posteriors to learn.

    Attributes:
        feature: (R, 7) features.
        wanted: (R, C) posteriors that the box classifier is to give.
        size: number of them in a step.
        shift: (C,) addend of the logits, as of Examples.
    """

    feature: Tensor
    wanted: Tensor
    size: int
    shift: Tensor

    @classmethod
    def of(cls, feature: Float64, wanted: Float64, size: int, shift: Float64) -> Boxes:
        """Boxes of arrays."""
        columns = [torch.from_numpy(column.astype(np.float32)) for column in (feature, wanted, shift)]
        return cls(columns[0], columns[1], size, columns[2])


def train_boxes(model: Model, data: Dataset, others: Sequence[Boxes], steps: int, seed: int) -> Model:
    """The model after training of its box classifier on others, and on its own posteriors for those of `data`."""
    feature = dataset_features(data, np.arange(len(data)))
    wanted = softmax(box_classifier.logits(model.boxes.layers, feature), axis=1)
    pools = [sampling_pools(data, rows) for rows in _all_and_simulated(data)]
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    drawn = np.concatenate([draw_batch(pool, rng, BOX_CROPS) for pool in pools])
    kept = Boxes.of(feature[drawn], wanted[drawn], BOX_SIZE, np.zeros(N_CLASSES))
    parts = (kept, *others)
    net = BoxStudent(model.boxes.layers)
    optimiser = torch.optim.AdamW(net.parameters(), weight_decay=1e-4)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, BOX_RATE, total_steps=steps, pct_start=0.1)
    for _ in range(steps):
        loss = torch.zeros(())
        for boxes in parts:
            rows = torch.from_numpy(rng.integers(0, len(boxes.feature), boxes.size))
            logits = net(boxes.feature[rows]) + boxes.shift
            loss = loss + nn.functional.cross_entropy(logits, boxes.wanted[rows], reduction="sum")
        optimiser.zero_grad()
        (loss / sum(boxes.size for boxes in parts)).backward()
        optimiser.step()
        schedule.step()
    weight = np.zeros(len(data))
    for rows_of_class, share in (pair for pool in pools for pair in pool):
        weight[rows_of_class] += 1 / len(rows_of_class) if share is None else share
    layers = net.layers()
    calibration = keep_posteriors(box_classifier.logits(layers, feature), wanted, weight / weight.sum())
    return replace(model, boxes=replace(model.boxes, layers=calibration.fold_into(layers)))


def _all_and_simulated(data: Dataset) -> tuple[Int, Int]:
    """All rows of a data set, and those of simulated sweeps; the same rows where all are simulated.

    Crops without objects (tools.train.bare_scans) are all simulated. As many simulated crops with objects are kept
    beside them, so that a model does not learn that what is simulated is background.
    """
    return np.arange(len(data)), np.flatnonzero(data.variant == SYNTHETIC)


def keep_posteriors(logits: Float64, wanted: Float64, weight: Float64) -> Calibration:
    """Calibration of (R, C) logits to posteriors (R, C), crops weighted by (R,), 1 in total.

    Classes of the user's own keep their logits, since the crops hold none of them.
    """
    own = np.zeros(N_CLASSES - N_SHIPPED)

    def loss(theta: Float64) -> float:
        offset = np.concatenate([[0.0], theta[1:], own])
        log_posterior = log_softmax(logits * np.exp(-theta[0]) + offset, axis=1)
        return -float(weight @ (wanted * log_posterior).sum(axis=1))

    found = minimize(loss, np.zeros(N_SHIPPED), method="L-BFGS-B").x
    return Calibration(float(np.exp(found[0])), np.concatenate([[0.0], found[1:], own]))


def save(path: Path, layers: Sequence[Layer], metadata: Mapping[str, str]) -> str:
    """Write a network with its metadata; returns its SHA-256."""
    network = graph(layers)
    helper.set_model_props(network, dict(metadata))
    raw = network.SerializeToString(deterministic=True)
    path.write_bytes(raw)
    return hashlib.sha256(raw).hexdigest()


def save_model(path: Path, trained: Model) -> str:
    """Write a model; returns its SHA-256."""
    boxes = {box_classifier.METADATA_KEY: json.dumps(classifier_entry(trained.boxes.layers, trained.boxes.weights))}
    frequency = {CLASS_FREQUENCY_KEY: json.dumps(np.exp(trained.log_frequency).tolist())}
    return save(path, trained.network.layers(), {**trained.metadata, **boxes, **frequency})


def street_examples(data: Dataset, rng: Generator) -> Examples:
    """Crops of simulated streets, as frequent as they are met."""
    local, rows = unchanged(data, [np.flatnonzero(data.trainable)], rng)
    return Examples(local, one_hot(data.label[rows]), STREET_SIZE, np.zeros(N_CLASSES))


def street_boxes(streets: Dataset) -> Boxes:
    """Boxes of simulated streets, as frequent as they are met."""
    rows = np.flatnonzero(streets.trainable)
    wanted = one_hot(streets.label[rows])
    return Boxes.of(dataset_features(streets, rows), wanted, BOX_STREET_SIZE, np.zeros(N_CLASSES))
