"""Training of the PointNet."""

from __future__ import annotations

import numpy as np
import pytest

from modt.classification.crops import Crops
from modt.types import N_REFLECTANCE
from tests.tools.train.datasets import data_of


def test_reflectance_evidence_is_zero_if_a_class_has_no_reflectance() -> None:
    pytest.importorskip("torch", reason="extra [train] is not installed")
    from tools.train.train_pointnet import reflectance_evidence

    reflectance = np.full((4, N_REFLECTANCE), 0.3)
    reflectance[1:] = np.nan  # background alone
    data = data_of(Crops(np.zeros((4, 3), np.float32), np.arange(5)), np.arange(4), reflectance=reflectance)
    assert not reflectance_evidence(data, np.arange(4), 0).any()
