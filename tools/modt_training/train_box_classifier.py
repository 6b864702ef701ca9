"""Training of the box classifier, modt.classification.box_classifier.

Crops are augmented as for the PointNet, and the boxes fitted to the augmented crops.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
import torch
from numpy.random import Generator

from modt.classes import CLASS_NAMES, N_CLASSES
from modt.classification.box_classifier import Layers, logits
from modt.types import Bool, Float64, Int
from modt_training.augment import augment, subsample
from modt_training.dataset import (
    BATCH_SIZE,
    FOLDS,
    SEED,
    Dataset,
    crop_features,
    dataset_features,
    draw_batch,
    sampling_pools,
)
from modt_training.held_out import Calibration, LogitsOfRows, fit_pool, out_of_fold
from modt_training.network import Batch, train_mlp
from modt_training.scores import by_sensor

STEPS = 2000
"""Steps of the training."""
AUGMENTED_BATCHES = 250
"""Batches that are augmented for the training, since augmentation costs more than a step."""
MAX_POINTS = 400
"""Maximum number of points of a crop before augmentation."""
THRESHOLDS = (0.005, 0.01, 0.02, 0.05, 0.1)
"""Object probabilities below which the share of each class is reported."""


def train(data: Dataset, rows: Int, steps: int, seed: int) -> Layers:
    """Train on rows of the data set; uncalibrated layers that take unnormalised features."""
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    pools = sampling_pools(data, rows)
    drawn = [draw_batch(pools, rng) for _ in range(AUGMENTED_BATCHES)]
    feature = np.concatenate([_augmented_features(data, rows, rng) for rows in drawn])
    label = data.label[np.concatenate(drawn)]

    def batch() -> Batch:
        chosen = rng.integers(0, len(label), 2 * BATCH_SIZE)
        return feature[chosen], label[chosen], 0.0

    return train_mlp(batch, feature, steps, rate=1e-2, decay=1e-3)


def _augmented_features(data: Dataset, rows: Int, rng: Generator) -> Float64:
    """(R, 7) features of rows of the data set, augmented."""
    crops = subsample(data.take(rows), MAX_POINTS, rng)
    return crop_features(*augment(crops, data.sensors.take(rows), rng))


def cross_validate(
    data: Dataset, network: Float64, k: int, steps: int, seed: int
) -> tuple[Calibration, dict[str, Any]]:
    """Calibration, share in the pool with the network, and scores from out-of-fold predictions.

    Args:
        data: all crops.
        network: (R, C) out-of-fold probabilities of the PointNet.
        k: number of folds.
        steps: training steps of a fold.
        seed: seed of the first fold.
    """

    def model(among: Bool, i: int) -> LogitsOfRows:
        layers = train(data, np.flatnonzero(among & data.trainable), steps, seed + i)
        return lambda rows: logits(layers, dataset_features(data, rows))

    held = out_of_fold(data, k, model)
    valid = held.validation
    box = held.probability
    weights, pool = fit_pool(network, box, np.zeros_like(box), valid, valid.weight)
    return held.calibration, {
        "weights": asdict(weights),
        "cross_validation": by_sensor(np.log(box), valid, valid.clear),
        "pool": by_sensor(pool, valid, valid.clear),
        "ruled_out": ruled_out(held.probability[valid.clear], valid.label[valid.clear]),
    }


def ruled_out(probability: Float64, label: Int) -> list[dict[str, Any]]:
    """Share of each class below each threshold of the object probability, from probabilities (R, C)."""
    return [
        {
            "likely": threshold,
            "share": dict(zip(CLASS_NAMES, _share_below(probability, label, threshold), strict=True)),
        }
        for threshold in THRESHOLDS
    ]


def _share_below(probability: Float64, label: Int, threshold: float) -> list[float]:
    below = 1.0 - probability[:, 0] < threshold
    return [round(float(below[label == c].mean()), 4) if (label == c).any() else 0.0 for c in range(N_CLASSES)]


def calibrated(data: Dataset, network: Float64) -> tuple[Layers, dict[str, Any]]:
    """Calibrated layers trained on all crops, and their report, of (R, C) out-of-fold probabilities of the PointNet.

    The report holds the weights of the pool with the network, out-of-fold scores by sensor of the box alone and of
    the pool, and the share of each class below each of THRESHOLDS.
    """
    calibration, report = cross_validate(data, network, FOLDS, STEPS, SEED)
    return calibration.fold_into(train(data, np.flatnonzero(data.trainable), STEPS, SEED)), report
