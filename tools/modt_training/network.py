"""The PointNet of section V-A at half width in PyTorch, its weights as arrays, and the small networks beside it.

Crops of a batch are concatenated, without padding. The last shared layer is normalised after the maximum, with a
positive scale, so that maximum, normalisation and ReLU commute.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import torch
from scipy.sparse import csr_matrix
from torch import Tensor, nn

from modt.classes import N_CLASSES
from modt.classification.box_classifier import Layers
from modt.types import Float64, Int
from modt_training.export_pointnet import Layer

SHARED = (3, 32, 64, 512)
"""Widths of the layers over points."""
HEAD = (512, 256, 128, N_CLASSES)
"""Widths of the layers after the maximum."""
BLOCK_POINTS = 768
"""Number of points that the widest shared layer takes at once; its products fit into a cache of 2 MB."""
DROPOUT = 0.3
"""Share of the last hidden layer that a training step leaves out."""
HIDDEN = (32, 32)
"""Widths of the small networks."""
Batch = tuple[Float64, Int, Float64 | float]
"""(R, F) features of crops, (R,) classes, and (R, C) logits to which the network's are added, or zero."""


class MaxPooledLinear(torch.autograd.Function):
    """Linear layer with maximum over the points of each crop; most of the cost of the network.

    Crops are multiplied some at a time, so that their products stay in the cache until their maxima are found. The
    gradient of a channel is non-zero at its maximum alone, so the backward pass uses sparse products.
    """

    @staticmethod
    def forward(ctx: Any, x: Tensor, weight: Tensor, count: Tensor) -> Tensor:
        """(R, out) of (K, in) points of R crops, an (out, in) weight and (R,) points of each crop."""
        point = x.detach().numpy()
        columns = np.ascontiguousarray(weight.detach().numpy().T)
        starts = np.append(0, np.cumsum(count.numpy()))
        maxima = np.empty((len(count), len(weight)), point.dtype)
        at_maximum = []
        for crops in _blocks(starts):
            y = point[starts[crops.start] : starts[crops.stop]] @ columns
            maxima[crops] = np.maximum.reduceat(y, starts[crops] - starts[crops.start])
            # Row by row, so the order is that of a CSR matrix. All points that share a maximum get its gradient.
            found = np.flatnonzero(y == np.repeat(maxima[crops], count.numpy()[crops], axis=0))
            at_maximum.append(found + starts[crops.start] * len(weight))
        ctx.saved = point, weight.detach().numpy(), np.concatenate(at_maximum), count.numpy()
        return torch.from_numpy(maxima)

    @staticmethod
    def backward(ctx: Any, *grad: Tensor) -> tuple[Tensor, Tensor, None]:
        """Gradients of points and weight."""
        x, weight, at_maximum, count = ctx.saved
        crop = np.repeat(np.arange(len(count)), count)
        point, channel = np.divmod(at_maximum, len(weight))
        starts = np.append(0, np.cumsum(np.bincount(point, minlength=len(x))))
        d_y = csr_matrix((grad[0].numpy()[crop[point], channel], channel, starts), shape=(len(x), len(weight)))
        return torch.from_numpy(d_y @ weight), torch.from_numpy(d_y.T @ x), None


def _blocks(starts: Int) -> Iterator[slice]:
    """Slices of crops of BLOCK_POINTS points at most, or of one crop, by the (R + 1,) first points of the crops."""
    first = 0
    while first < len(starts) - 1:
        stop = int(np.searchsorted(starts, starts[first] + BLOCK_POINTS, side="right")) - 1
        yield slice(first, max(stop, first + 1))
        first = max(stop, first + 1)


class PositiveScaleNorm(nn.Module):
    """Batch normalisation with a positive scale."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.norm = nn.BatchNorm1d(width, affine=False)
        self.log_scale = nn.Parameter(torch.zeros(width))
        self.shift = nn.Parameter(torch.zeros(width))

    def forward(self, x: Tensor) -> Tensor:
        """(b, width) normalised."""
        normal: Tensor = self.norm(x)
        return normal * self.log_scale.exp() + self.shift

    def folded(self, weight: Tensor) -> tuple[Tensor, Tensor]:
        """Weight (out, in) and bias (out,) of the preceding bias-free layer with the normalisation folded in."""
        mean = self.norm.running_mean
        var = self.norm.running_var
        assert mean is not None
        assert var is not None
        scale = self.log_scale.double().exp() / torch.sqrt(var.double() + self.norm.eps)
        return weight.double() * scale[:, None], self.shift.double() - mean.double() * scale


class PointNet(nn.Module):
    """Shared layers over points, maximum over points, fully connected head."""

    def __init__(self) -> None:
        super().__init__()
        self.shared = nn.ModuleList(nn.Linear(a, b, bias=False) for a, b in pairwise(SHARED))
        self.head = nn.ModuleList(nn.Linear(a, b, bias=False) for a, b in pairwise(HEAD[:-1]))
        self.norms = nn.ModuleList(PositiveScaleNorm(width) for width in (*SHARED[1:], *HEAD[1:-1]))
        self.last = nn.Linear(*HEAD[-2:])
        self.dropout = nn.Dropout(DROPOUT)

    def forward(self, xyz: Tensor, count: Tensor) -> Tensor:
        """(R, C) logits of R crops: (K, 3) concatenated points, (R,) points of each crop."""
        h = xyz
        for layer, norm in zip(self.shared[:-1], self.norms, strict=False):
            h = torch.relu(norm(layer(h)))
        h = MaxPooledLinear.apply(h, self.shared[-1].weight, count)
        h = torch.relu(self.norms[len(self.shared) - 1](h))
        for layer, norm in zip(self.head, self.norms[len(self.shared) :], strict=True):
            h = torch.relu(norm(layer(h)))
        logits: Tensor = self.last(self.dropout(h))
        return logits

    def layers(self) -> list[Layer]:
        """(in, out) weight and (out,) bias of each layer, normalisation folded in, first to last."""
        folded = [
            norm.folded(layer.weight) for layer, norm in zip([*self.shared, *self.head], self.norms, strict=True)
        ]
        folded.append((self.last.weight.double(), self.last.bias.double()))
        return [(w.detach().T.float().numpy().copy(), b.detach().float().numpy().copy()) for w, b in folded]


def train_mlp(batch: Callable[[], Batch], sample: Float64, steps: int, rate: float, decay: float) -> Layers:
    """Train a network; uncalibrated layers that take unnormalised features.

    Args:
        batch: returns the next batch.
        sample: (S, F) features, for their mean and standard deviation.
        steps: number of batches.
        rate: maximum learning rate.
        decay: weight decay.
    """
    mean = sample.mean(axis=0)
    scale = sample.std(axis=0)
    scale = np.where(scale > 0, scale, 1.0)  # of a feature that never varies
    linear = [nn.Linear(a, b) for a, b in pairwise((sample.shape[1], *HIDDEN, N_CLASSES))]
    net = nn.Sequential(*[part for layer in linear for part in (layer, nn.Tanh())][:-1])
    optimiser = torch.optim.AdamW(net.parameters(), weight_decay=decay)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, rate, total_steps=steps)
    criterion = nn.CrossEntropyLoss()
    for _ in range(steps):
        feature, label, base = batch()
        score = net(torch.from_numpy(((feature - mean) / scale).astype(np.float32)))
        loss = criterion(score + torch.from_numpy(np.asarray(base, np.float32)), torch.from_numpy(label))
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        schedule.step()
    layers = [(p.weight.detach().double().numpy().T, p.bias.detach().double().numpy()) for p in linear]
    weight, bias = layers[0]
    weight = weight / scale[:, None]
    return [(weight, bias - mean @ weight), *layers[1:]]
