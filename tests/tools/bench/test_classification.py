"""Benchmark of the classifier."""

import numpy as np
import pytest

from tests.classification.scenes import blobs


def test_the_textbook_graph_equals_the_exported_one():
    pytest.importorskip("onnx", reason="extra [train] is not installed")
    from modt.classification.pointnet import PointNet
    from modt.config import ClassificationConfig, SensorConfig
    from tools.bench.classification import bare, textbook

    shipped = PointNet(ClassificationConfig(), SensorConfig())
    naive, ours = (bare(shipped, SensorConfig(), pool_first=first) for first in (False, True))
    points, proposals = blobs([6, 40, 128], np.random.default_rng(1))
    expected = ours.classify(points, proposals, np.arange(3))
    np.testing.assert_allclose(textbook(naive, points, proposals, 2, SensorConfig()), expected, atol=1e-5)
