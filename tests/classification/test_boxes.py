"""What a box says is learnt from crops and asked of proposals: both must describe it alike."""

from __future__ import annotations

import numpy as np
import pytest

from crop_boxes import all_described, described
from dataset import SENSOR_HEIGHT_M, Dataset
from modt.classification.crops import Crops, gather
from modt.classification.prior import N_FEATURES, beam_sr, features
from modt.config import SegmentationConfig, SensorConfig
from modt.geometry import FieldOfView
from modt.segmentation.segmenter import Segmenter
from modt.sources.synthetic import SyntheticStream
from modt.types import Float64, Int


def test_crops_say_of_their_boxes_what_proposals_do() -> None:
    sensor = SensorConfig(height_m=SENSOR_HEIGHT_M)
    frame = next(iter(SyntheticStream("street", "hdl-64e", 0.1, seed=4)))
    proposals = Segmenter(SegmentationConfig(), sensor, FieldOfView()).segment(frame.points)
    crops = gather(frame.points, proposals, np.arange(len(proposals)), 100_000)
    step_sr = beam_sr(sensor.azimuth_step_deg, sensor.elevation_step_deg)
    expected = features(proposals.count, proposals.box, SENSOR_HEIGHT_M, step_sr)
    assert len(crops) > 50
    off = np.abs(described(crops) - expected)
    assert off[:, 4:].max() < 1e-3  # height, foot and top
    assert np.quantile(off[:, :4], 0.9, axis=0).max() < 0.15  # at run time headings are fitted to fewer points


def cubes(sides_m: Float64, label: Int, rng: np.random.Generator) -> Dataset:
    """Cubes of these sides, ten metres ahead, in four drives."""
    n = len(sides_m)
    xyz = (rng.uniform(-0.5, 0.5, (n, 60, 3)) * sides_m[:, None, None] + [10.0, 0.0, -1.0]).reshape(-1, 3)
    crops = Crops(xyz.astype(np.float32), np.arange(n + 1) * 60)
    none, variant, drive = np.zeros(n, np.bool_), np.zeros(n, np.int64), np.arange(n) % 4
    return Dataset(crops, label, none, none, none, variant, drive, label, drive, provenance=[], sha256=[])


def test_training_finds_what_sizes_tell() -> None:
    pytest.importorskip("torch", reason="extra [train] is not installed")
    from modt.classification.prior import logits
    from train_boxes import cross_validate, train

    rng = np.random.default_rng(0)
    label = np.arange(80) // 2 % 4
    data = cubes(0.1 * 4.0**label, label, rng)
    layers = train(data, np.arange(80), 150, seed=1)
    again = train(data, np.arange(80), 150, seed=1)
    feature = all_described(data, np.arange(80))
    assert feature.shape == (80, N_FEATURES)
    assert np.mean(logits(layers, feature).argmax(axis=1) == label) > 0.9
    assert all(
        (a == b).all() for one, other in zip(layers, again, strict=True) for a, b in zip(one, other, strict=True)
    )
    _, report = cross_validate(data, 2, 150, seed=1)
    assert min(report["average_precision"].values()) > 0.8
    shares = [row["share"]["background"] for row in report["ruled_out"]]
    assert shares == sorted(shares)
