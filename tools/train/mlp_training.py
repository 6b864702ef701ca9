"""Training of the small networks stored in the metadata of a model, modt.classification.box_classifier."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import torch
from torch import nn

from modt.classes import N_CLASSES
from modt.classification.box_classifier import Layers
from modt.types import Float64, Int

HIDDEN = (32, 32)


Batch = tuple[Float64, Int, Float64 | float]
"""(R, F) features of crops, (R,) their classes, and (R, 4) logits that those of the network are added to, or zero."""


def train_mlp(batch: Callable[[], Batch], sample: Float64, steps: int, rate: float, decay: float) -> Layers:
    """Train a network; uncalibrated layers that take unnormalised features.

    Args:
        batch: returns the next batch.
        sample: (S, F) features, for their mean and standard deviation.
        steps: number of batches.
        rate: maximum learning rate.
        decay: weight decay.
    """
    mean, scale = sample.mean(axis=0), sample.std(axis=0)
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
