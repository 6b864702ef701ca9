"""The class that is said of a track: what a missed object costs, and how frequent the classes are in this stream.

A posterior holds for the class frequencies that the model was trained to assume. Those of the stream are estimated
from the posteriors themselves (M. Saerens et al., "Adjusting the outputs of a classifier to new a priori
probabilities", Neural Computation 2002), slowly and within bounds: no object becomes rarer than the model assumes,
since the first of its class may still come. An object is said where its expected cost, if it were missed, exceeds
that of a false one. The class that was said last needs less: a posterior that falls because the object is half
hidden says little against what was seen before.
"""

from __future__ import annotations

import numpy as np

from modt.classes import N_CLASSES
from modt.config import DecisionConfig
from modt.types import NONE, Float64, Tracks

MIN_BACKGROUND = 0.1
"""Least frequency of background."""


class Decision:
    """Posteriors to classes.

    Args:
        config: costs, and the pace and bounds of the adaptation.
        frequency: (4,) of the classes among proposals, which the posteriors assume.

    Attributes:
        frequency: (4,) of the classes among the proposals of this stream, as estimated so far.
    """

    def __init__(self, config: DecisionConfig, frequency: Float64) -> None:
        self.config = config
        self._assumed = frequency
        start = config.frequency
        self._start = frequency if start is None else np.array([1.0 - sum(start), *start])
        self.frequency = self._start.copy()
        self._mass = np.zeros(N_CLASSES)
        self._threshold = 1.0 / (1.0 + np.array(config.missed_cost))

    def decide(self, tracks: Tracks) -> None:
        """Write the class of every track; those with a proposal add to the frequency of the classes."""
        adapted = self.adapted(tracks.posterior)
        rows, weighed = np.arange(len(adapted)), adapted.copy()
        weighed[rows, tracks.object_class] /= self.config.hysteresis
        likeliest = weighed[:, 1:].argmax(axis=1) + 1
        said = weighed[rows, likeliest] >= self._threshold[likeliest - 1]
        tracks.object_class = np.where(said, likeliest, 0)
        self._learn(adapted[tracks.proposal != NONE])

    def adapted(self, posterior: Float64) -> Float64:
        """(M, 4) posteriors under the frequencies of the stream."""
        weighted = posterior * (self.frequency / self._assumed)
        adapted: Float64 = weighted / weighted.sum(axis=1, keepdims=True)
        return adapted

    def _learn(self, adapted: Float64) -> None:
        """The mean of the adapted posteriors, the frequency at the start counting as `start_proposals`."""
        config = self.config
        self._mass += adapted.sum(axis=0)
        total = self._mass.sum()
        if total > config.memory_proposals:
            self._mass *= config.memory_proposals / total
        frequency = config.start_proposals * self._start + self._mass
        frequency /= frequency.sum()
        frequency[1:] = np.minimum(np.maximum(frequency, self._assumed), self._assumed * config.max_change)[1:]
        frequency[0] = max(1.0 - frequency[1:].sum(), MIN_BACKGROUND)
        self.frequency = frequency / frequency.sum()
