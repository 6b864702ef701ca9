"""Train the reflectance classifier, modt.classification.reflectance_classifier (extra [train]).

    python -m tools.train.train_reflectance_classifier OUT_DIR CROPS.npz... --sensor NAME
                                    [--steps N] [--folds K] [--seed S]

OUT_DIR holds the output of train_pointnet and train_box_classifier for the same crops and folds. The crops of a
sensor are those of this name, thinned ones too. Writes OUT_DIR/reflectance-NAME.npz for export_pointnet and
OUT_DIR/reflectance-NAME.json: the weights of the pool of all three, and out-of-fold scores by sensor of box with
reflectance and of all three.
"""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import torch
from scipy.special import softmax

from modt.classification.box_classifier import Layers, logits
from modt.config.profile import REFLECTANCE_SCALES
from modt.types import Bool, Float64, Int
from tools.options import make_torch_deterministic, training_parser
from tools.train import train_box_classifier
from tools.train.batches import draw_batch, sampling_pools
from tools.train.box_features import dataset_features
from tools.train.dataset import Dataset, load
from tools.train.held_out import Model, Validation, load_network, out_of_fold
from tools.train.mlp_training import Batch, train_mlp
from tools.train.pool_fit import fit_pool
from tools.train.scores import by_sensor
from tools.train.temperature_scaling import Calibration, fit_calibration
from tools.train.weights import load_layers, save_layers

STEPS = 600
JITTER = 0.1
"""Noise added to the features of a batch, as a fraction of their standard deviation; few crops are drawn often."""


class Features:
    """Features of all crops of a data set, without augmentation.

    Attributes:
        box: (R, 7) of the boxes.
        all: (R, 12) of box and reflectance.
    """

    def __init__(self, data: Dataset) -> None:
        self.box = dataset_features(data, np.arange(len(data)))
        self.all = np.hstack([self.box, data.reflectance])


def on_scale(data: Dataset, sensor: str) -> Dataset:
    """The data set with the reflectance of one sensor alone."""
    own = np.array([name.split(",")[0] == sensor for name in data.sensor_names])[data.sensor]
    return replace(data, reflectance=np.where(own[:, None], data.reflectance, np.nan))


def has_reflectance(data: Dataset, rows: Int) -> Bool:
    """(R,) whether the reflectance of rows is known."""
    return np.asarray(np.isfinite(data.reflectance[rows]).all(axis=1))


def train(data: Dataset, features: Features, rows: Int, boxes: Layers, steps: int, seed: int) -> Layers:
    """Train on rows of the data set; uncalibrated layers whose logits are added to those of the box layers."""
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    pools = sampling_pools(data, rows[has_reflectance(data, rows)])
    base = logits(boxes, features.box)
    sample = features.all[np.concatenate([draw_batch(pools, rng) for _ in range(16)])]
    scale = JITTER * sample.std(axis=0)

    def batch() -> Batch:
        chosen = np.concatenate([draw_batch(pools, rng), draw_batch(pools, rng)])
        feature = features.all[chosen]
        return Batch(feature + rng.normal(0.0, scale, feature.shape), data.label[chosen], base[chosen])

    return train_mlp(batch, sample, steps, rate=5e-3, decay=1e-2)


def cross_validate(
    data: Dataset, features: Features, network: Float64, k: int, steps: int, seed: int
) -> tuple[Calibration, dict[str, Any]]:
    """Calibration, pool weights and scores from out-of-fold predictions for the crops with reflectance.

    The evidence is fitted to crops weighted to the class frequency that box and network assume: it adds none.

    Args:
        data: all crops.
        features: of them.
        network: (R, 4) out-of-fold probabilities of the PointNet.
        k: number of folds.
        steps: training steps of a fold.
        seed: of the first fold.
    """
    boxes: dict[int, Layers] = {}

    def box_model(among: Bool, i: int) -> Model:
        layers = train_box_classifier.train(
            data, np.flatnonzero(among & data.trainable), train_box_classifier.STEPS, seed + i
        )
        boxes[i] = layers
        return lambda rows: logits(layers, features.box[rows])

    by_box = out_of_fold(data, k, box_model)

    def reflectance_model(among: Bool, i: int) -> Model:
        calibrated = [*boxes[i][:-1], by_box.calibration.fold_into(boxes[i][-1])]
        layers = train(data, features, np.flatnonzero(among & data.trainable), calibrated, steps, seed + i)
        return lambda rows: logits(layers, np.nan_to_num(features.all[rows]))

    held = out_of_fold(data, k, reflectance_model)
    valid = held.validation
    known = has_reflectance(data, valid.rows)
    weight = valid.weight_of(known)
    box = np.log(by_box.probability)
    calibration = fit_calibration(held.logits, valid.label, weight, box)
    evidence = (held.logits / calibration.temperature + calibration.offset) * known[:, None]
    pool = fit_pool(network, by_box.probability, evidence, valid, weight)
    clear = valid.clear & known
    return calibration, {
        "weights": pool.weights.as_dict(),
        "cross_validation": by_sensor(box + evidence, valid, known),
        "pool": by_sensor(pool.log_posterior, valid, known),
        "ruled_out": train_box_classifier.ruled_out(softmax((box + evidence)[clear], axis=1), valid.label[clear]),
    }


def main() -> None:
    parser = training_parser(__doc__)
    parser.add_argument("--sensor", required=True, choices=REFLECTANCE_SCALES, help="that measured the reflectance")
    parser.add_argument("--steps", type=int, default=STEPS)
    args = parser.parse_args()
    make_torch_deterministic()
    data = on_scale(load(*args.crops), args.sensor)
    features = Features(data)
    network = load_network(args.out, data)
    if not has_reflectance(data, Validation.of(data).rows).any():
        print(f"no reflectance of {args.sensor} to validate by: the model has no classifier of it")
        return
    calibration, report = cross_validate(data, features, network, args.folds, args.steps, args.seed)
    boxes = load_layers(args.out / "boxes.npz")
    layers = train(data, features, np.flatnonzero(data.trainable), boxes, args.steps, args.seed)
    save_layers(args.out / f"reflectance-{args.sensor}.npz", [*layers[:-1], calibration.fold_into(layers[-1])])
    report |= {"sensor": args.sensor, "steps": args.steps, "seed": args.seed}
    (args.out / f"reflectance-{args.sensor}.json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    print(json.dumps(report))


if __name__ == "__main__":
    main()
