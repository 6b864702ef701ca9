"""What a network is told that its crops are: their labels, or what an ensemble of earlier networks sees in them.

An ensemble is better than any of its members, since each errs in its own way, and it has an opinion of crops that
nobody labelled (G. Hinton et al., "Distilling the Knowledge in a Neural Network", 2015).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
import torch
from numpy.random import Generator
from torch import Tensor, nn

from modt.classes import N_CLASSES
from modt.types import Float64, Int

SMOOTHING = 0.02
"""Of a label, spread evenly over the classes."""
TRUST = 0.8
"""In the evidence of returns, which is not calibrated; what the pool takes of it, about."""


class Teaching(Protocol):
    """Tells what the crops of a batch are."""

    def further(self, rng: Generator) -> Int:
        """(F,) rows to be shown besides those drawn for their labels."""
        ...

    def targets(self, xyz: Tensor, count: Tensor, label: Int, further: Int) -> Tensor:
        """(R, 4) what the network should say of R crops, given as it sees them, the labelled ones first.

        Args:
            xyz: (K, 3) points, one crop after another.
            count: (R,) points of each.
            label: of the labelled ones.
            further: (F,) rows of the others.
        """
        ...


class Labels:
    """Goes by the labels, and shows nothing else."""

    def further(self, rng: Generator) -> Int:
        """(0,) rows."""
        return np.zeros(0, np.int64)

    def targets(self, xyz: Tensor, count: Tensor, label: Int, further: Int) -> Tensor:
        """(R, 4) the labels, softened a little."""
        hard = nn.functional.one_hot(torch.from_numpy(label), N_CLASSES)
        return hard * (1 - SMOOTHING) + SMOOTHING / N_CLASSES


class Ensemble:
    """Goes by the mean of some networks, also of crops without a label, and of these by their returns besides.

    The network sees the shape alone; what brightness tells its teachers of a crop it learns to see in the shape.

    Args:
        teachers: networks that never saw what the taught one will be judged by.
        unlabelled: (U,) rows without a label.
        number: of those shown with each batch.
        evidence: (N, 4) what its returns add to the logarithms of the probabilities of each crop.
    """

    def __init__(self, teachers: Sequence[nn.Module], unlabelled: Int, number: int, evidence: Float64) -> None:
        self.teachers, self.unlabelled, self.evidence = teachers, unlabelled, TRUST * evidence
        self.number = number if len(unlabelled) else 0

    def further(self, rng: Generator) -> Int:
        """(F,) rows without a label."""
        return rng.choice(self.unlabelled, self.number) if self.number else np.zeros(0, np.int64)

    @torch.no_grad()
    def targets(self, xyz: Tensor, count: Tensor, label: Int, further: Int) -> Tensor:
        """(R, 4) mean probabilities, with the evidence of the further ones."""
        said = torch.stack([torch.softmax(net(xyz, count), dim=1) for net in self.teachers]).mean(dim=0)
        said[len(label) :] *= torch.from_numpy(np.exp(self.evidence[further]).astype(np.float32))
        return said / said.sum(dim=1, keepdim=True)
