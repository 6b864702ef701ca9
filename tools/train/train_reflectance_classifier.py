"""Training of the reflectance classifiers, modt.classification.reflectance_classifier, one for each sensor.

The crops of a sensor are those of this name, thinned ones too.
"""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Any

import numpy as np
import torch
from scipy.special import softmax

from modt.classification.box_classifier import N_FEATURES, Layers, logits
from modt.types import Bool, Float64, Int
from modt_training import train_box_classifier
from modt_training.dataset import FOLDS, SEED, Dataset, dataset_features, draw_batch, sampling_pools
from modt_training.held_out import Calibration, LogitsOfRows, Validation, fit_calibration, fit_pool, out_of_fold
from modt_training.network import Batch, train_mlp
from modt_training.scores import by_sensor

STEPS = 600
JITTER = 0.1
"""Noise added to the features of a batch, as a fraction of their standard deviation; few crops are drawn often."""


def features_of(data: Dataset) -> Float64:
    """(R, 12) features of box and reflectance of all crops of a data set, without augmentation."""
    return np.hstack([dataset_features(data, np.arange(len(data))), data.reflectance])


def on_scale(data: Dataset, sensor: str) -> Dataset:
    """The data set with the reflectance of one sensor alone."""
    of_sensor = np.array([name.split(",")[0] == sensor for name in data.sensor_names])[data.sensor]
    return replace(data, reflectance=np.where(of_sensor[:, None], data.reflectance, np.nan))


def has_reflectance(data: Dataset, rows: Int) -> Bool:
    """(R,) whether the reflectance of rows is known."""
    return np.asarray(np.isfinite(data.reflectance[rows]).all(axis=1))


def train(data: Dataset, features: Float64, rows: Int, boxes: Layers, steps: int, seed: int) -> Layers:
    """Train on rows of the data set; uncalibrated layers whose logits are added to those of the box layers."""
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    pools = sampling_pools(data, rows[has_reflectance(data, rows)])
    base = logits(boxes, features[:, :N_FEATURES])
    sample = features[np.concatenate([draw_batch(pools, rng) for _ in range(16)])]
    scale = JITTER * sample.std(axis=0)

    def batch() -> Batch:
        chosen = np.concatenate([draw_batch(pools, rng), draw_batch(pools, rng)])
        feature = features[chosen]
        return feature + rng.normal(0.0, scale, feature.shape), data.label[chosen], base[chosen]

    return train_mlp(batch, sample, steps, rate=5e-3, decay=1e-2)


def cross_validate(
    data: Dataset, features: Float64, network: Float64, k: int, steps: int, seed: int
) -> tuple[Calibration, dict[str, Any]]:
    """Calibration, pool weights and scores from out-of-fold predictions for the crops with reflectance.

    The evidence is fitted to crops weighted to the class frequency that box and network assume: it adds none.

    Args:
        data: all crops.
        features: (R, 12) features of the crops.
        network: (R, C) out-of-fold probabilities of the PointNet.
        k: number of folds.
        steps: training steps of a fold.
        seed: seed of the first fold.
    """
    boxes: dict[int, Layers] = {}

    def box_model(among: Bool, i: int) -> LogitsOfRows:
        layers = train_box_classifier.train(
            data, np.flatnonzero(among & data.trainable), train_box_classifier.STEPS, seed + i
        )
        boxes[i] = layers
        return lambda rows: logits(layers, features[rows, :N_FEATURES])

    by_box = out_of_fold(data, k, box_model)

    def reflectance_model(among: Bool, i: int) -> LogitsOfRows:
        base = by_box.calibration.fold_into(boxes[i])
        layers = train(data, features, np.flatnonzero(among & data.trainable), base, steps, seed + i)
        return lambda rows: logits(layers, np.nan_to_num(features[rows]))

    held = out_of_fold(data, k, reflectance_model)
    valid = held.validation
    known = has_reflectance(data, valid.rows)
    weight = valid.weight_of(known)
    box = np.log(by_box.probability)
    calibration = fit_calibration(held.logits, valid.label, weight, box)
    evidence = (held.logits / calibration.temperature + calibration.offset) * known[:, None]
    weights, pool = fit_pool(network, by_box.probability, evidence, valid, weight)
    clear = valid.clear & known
    return calibration, {
        "weights": asdict(weights),
        "cross_validation": by_sensor(box + evidence, valid, known),
        "pool": by_sensor(pool, valid, known),
        "ruled_out": train_box_classifier.ruled_out(softmax((box + evidence)[clear], axis=1), valid.label[clear]),
    }


def calibrated(data: Dataset, sensor: str, network: Float64, boxes: Layers) -> tuple[Layers, dict[str, Any]] | None:
    """Calibrated layers of a sensor and their report; None if there are no crops of it to validate with.

    Args:
        data: all R crops.
        sensor: name of the sensor that measured the reflectance.
        network: (R, C) out-of-fold probabilities of the PointNet.
        boxes: calibrated layers of the box classifier.
    """
    data = on_scale(data, sensor)
    if not has_reflectance(data, Validation.of(data).rows).any():
        print(f"no reflectance of {sensor} to validate by: the model has no classifier of it")
        return None
    features = features_of(data)
    calibration, report = cross_validate(data, features, network, FOLDS, STEPS, SEED)
    layers = train(data, features, np.flatnonzero(data.trainable), boxes, STEPS, SEED)
    return calibration.fold_into(layers), report | {"sensor": sensor}
