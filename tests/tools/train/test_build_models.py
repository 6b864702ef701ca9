"""From labelled scans to a model with its card."""

import json
import sys

import numpy as np
import pytest

from modt.app import assembly
from modt.classification.network import ort
from modt.config import ClassificationConfig, SensorConfig
from modt_training.simulated import simulated_scans
from tests.tools.train.datasets import write_folder
from tools.train import build_models


@pytest.mark.slow
def test_one_command_trains_on_scans_of_ones_own(tmp_path, monkeypatch):
    pytest.importorskip("torch", reason="extra [train] is not installed")
    shipped = set(build_models.MODELS.glob("*.onnx"))
    scans = simulated_scans(["street", "crossing"], [3, 4], [0.0], camera=False, sensors=["vlp-16"])
    write_folder(tmp_path / "mine", scans)
    monkeypatch.setattr(build_models, "WORLDS", 4)
    monkeypatch.setattr(build_models, "NEAR_WORLDS", {1: 12, 2: 12})
    monkeypatch.setattr(build_models, "BARE_WORLDS", {3: 12, 4: 12})
    monkeypatch.setattr(build_models, "PEOPLE_WORLDS", {5: 6, 7: 6, 6: 6})
    sparse = {kind: (seed, 3, ("vlp-16",)) for seed, kind in enumerate(build_models.SPARSE_WORLDS, 12)}
    monkeypatch.setattr(build_models, "SPARSE_WORLDS", sparse)
    monkeypatch.setattr(build_models, "RIDER_WORLDS", {8: 6, 9: 6})
    monkeypatch.setattr(build_models, "WORN_WORLDS", {10: 3, 11: 3})
    monkeypatch.setattr(build_models, "STREET_WORLDS", {900_000: 4, 900_500: 4})
    monkeypatch.setattr(build_models, "NEAR_STEPS", 10)
    options = ["--scans", str(tmp_path / "mine"), "--profile", "vlp-16", "--steps", "10"]
    monkeypatch.setattr(sys, "argv", ["build_models", str(tmp_path), *options])
    build_models.main()
    path = tmp_path / "pointnet-scans.onnx"
    assembly.network(ClassificationConfig(model=str(path)), SensorConfig())  # checks the hash on the card
    card = path.with_suffix(".md").read_text(encoding="utf-8")
    assert "| vlp-16 |" in card
    assert "## Trained further" in card
    metadata = ort.InferenceSession(path).get_modelmeta().custom_metadata_map
    beside = ort.InferenceSession(tmp_path / "pointnet-scans-near.onnx").get_modelmeta().custom_metadata_map
    assert len(json.loads(beside["box_bounds"])) == 3
    frequency = json.loads(metadata["class_frequency"])
    assert np.sum(frequency) == pytest.approx(1.0, abs=1e-3)
    assert frequency[0] > 0.7
    assert set(build_models.MODELS.glob("*.onnx")) == shipped
