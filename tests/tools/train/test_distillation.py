"""Training targets."""

from __future__ import annotations

import numpy as np
import pytest


def test_ensemble_targets_are_the_mean_with_evidence_for_unlabelled_crops() -> None:
    torch = pytest.importorskip("torch", reason="extra [train] is not installed")
    from tools.train.distillation import EVIDENCE_WEIGHT, EnsembleTargets, LabelTargets

    rng = np.random.default_rng(0)
    xyz, count, label = torch.randn(9, 3), torch.tensor([4, 3, 2]), np.array([1, 3])
    logits = torch.tensor([[[9.0, 0, 0, 0], [0, 9, 0, 0], [0, 0, 0, 9]], [[9, 0, 0, 0], [0, 0, 9, 0], [0, 0, 0, 9]]])
    evidence = rng.normal(size=(90, 4))
    ensemble = EnsembleTargets([lambda xyz, count, own=own: own for own in logits], np.arange(70, 90), 5, evidence)
    assert (np.isin(ensemble.draw_unlabelled(rng), np.arange(70, 90))).all()
    assert len(ensemble.draw_unlabelled(rng)) == 5
    expected = torch.softmax(logits, dim=2).mean(dim=0)
    expected[2] *= torch.from_numpy(np.exp(EVIDENCE_WEIGHT * evidence[77]))
    expected[2] /= expected[2].sum()
    assert torch.allclose(ensemble.targets(xyz, count, label, np.array([77])), expected)
    assert len(EnsembleTargets([], np.zeros(0, np.int64), 5, evidence).draw_unlabelled(rng)) == 0
    assert len(LabelTargets().draw_unlabelled(rng)) == 0
    smoothed = LabelTargets().targets(xyz[:7], count[:2], label, np.zeros(0, np.int64))
    assert smoothed.argmax(dim=1).tolist() == label.tolist()
    assert torch.allclose(smoothed.sum(dim=1), torch.ones(2))
