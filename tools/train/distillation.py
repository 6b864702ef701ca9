"""Training targets of the PointNet: labels, or the mean prediction of an ensemble of earlier networks.

An ensemble is more accurate than its members and gives targets for unlabelled crops (G. Hinton et al., "Distilling
the Knowledge in a Neural Network", 2015).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
import torch
from numpy.random import Generator
from torch import Tensor, nn

from modt.classes import N_CLASSES
from modt.types import Float64, Int

SMOOTHING = 0.02
"""Label smoothing: probability spread evenly over the classes."""
EVIDENCE_WEIGHT = 0.8
"""Weight of the uncalibrated reflectance evidence; about its weight in the pool."""


class TargetSource(Protocol):
    """Target probabilities of the crops of a batch."""

    def draw_unlabelled(self, rng: Generator) -> Int:
        """(U,) unlabelled rows to append to a batch."""
        ...

    def targets(self, xyz: Tensor, count: Tensor, label: Int, unlabelled: Int) -> Tensor:
        """(R, 4) target probabilities of the crops of a batch, the labelled ones first.

        Args:
            xyz: (K, 3) input of the network, crop after crop.
            count: (R,) points of each crop.
            label: (L,) classes of the labelled crops.
            unlabelled: (U,) rows of the unlabelled crops, R = L + U.
        """
        ...


class LabelTargets:
    """Smoothed labels; no unlabelled crops."""

    def draw_unlabelled(self, rng: Generator) -> Int:
        """(0,) rows."""
        return np.zeros(0, np.int64)

    def targets(self, xyz: Tensor, count: Tensor, label: Int, unlabelled: Int) -> Tensor:
        """(L, 4) smoothed labels."""
        hard = nn.functional.one_hot(torch.from_numpy(label), N_CLASSES)
        return hard * (1 - SMOOTHING) + SMOOTHING / N_CLASSES


class EnsembleTargets:
    """Mean prediction of the teachers, for unlabelled crops multiplied by the reflectance evidence.

    The network sees the shape alone; reflectance thereby contributes to its targets.

    Args:
        teachers: networks trained without the validation crops.
        unlabelled: (U,) rows without a label.
        number: unlabelled crops of a batch.
        evidence: (N, 4) log-likelihood of the classes from the reflectance of each row.
    """

    def __init__(
        self, teachers: Sequence[Callable[[Tensor, Tensor], Tensor]], unlabelled: Int, number: int, evidence: Float64
    ) -> None:
        self.teachers, self.unlabelled, self.evidence = teachers, unlabelled, EVIDENCE_WEIGHT * evidence
        self.number = number if len(unlabelled) else 0

    def draw_unlabelled(self, rng: Generator) -> Int:
        """(U,) rows without a label."""
        return rng.choice(self.unlabelled, self.number) if self.number else np.zeros(0, np.int64)

    @torch.no_grad()
    def targets(self, xyz: Tensor, count: Tensor, label: Int, unlabelled: Int) -> Tensor:
        """(R, 4) mean probabilities."""
        mean = torch.stack([torch.softmax(net(xyz, count), dim=1) for net in self.teachers]).mean(dim=0)
        mean[len(label) :] *= torch.from_numpy(np.exp(self.evidence[unlabelled]).astype(np.float32))
        return mean / mean.sum(dim=1, keepdim=True)
