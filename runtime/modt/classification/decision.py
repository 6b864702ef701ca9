"""The reported class of a track: what a missed object costs, and how frequent the classes are in this stream.

A posterior holds for the class frequencies that the model was trained to assume. Those of the stream are estimated
from the posteriors themselves (M. Saerens et al., "Adjusting the outputs of a classifier to new a priori
probabilities", Neural Computation 2002), slowly and within bounds: no object becomes rarer than the model assumes,
since the first of its class may yet come. An object is reported where its expected cost, if it were missed, exceeds
that of a false one. The class that was reported last needs less, since a posterior also falls while the object is
half hidden.
"""

from __future__ import annotations

import numpy as np

from modt.classes import N_CLASSES
from modt.config import DecisionConfig
from modt.types import Decisions, Evidence, Float64, Motion

MIN_BACKGROUND = 0.1
"""Least frequency of background."""
KEPT_FROM = 0.4
"""A reported class is kept down to this probability if its threshold is higher; less: doubtful classes linger."""
START_PROPOSALS, MEMORY_PROPOSALS = 2000, 20_000
"""Weight of the frequency at the start, and of the memory of the stream, as numbers of proposals."""
MAX_CHANGE = 5.0
"""A class becomes at most so many times as frequent as the model assumes."""


class LikeliestClass:
    """The likeliest object, where its posterior reaches its threshold: nothing is adapted or remembered.

    Args:
        config: costs.
        frequency: (4,) frequencies of the classes among proposals that the posteriors assume; also an attribute.
    """

    def __init__(self, config: DecisionConfig, frequency: Float64) -> None:
        self.frequency = frequency
        self._threshold = 1.0 / (1.0 + np.array(config.missed_cost))

    def decide(self, decisions: Decisions, evidence: Evidence, motion: Motion) -> None:
        """Write the class of every track."""
        self._report(decisions, evidence.posterior.T)

    def _report(self, decisions: Decisions, weighed: Float64) -> None:
        """Write the class of every track by the weights (4, M) of its classes."""
        likeliest = weighed[1:].argmax(axis=0)
        reported = weighed[1:].max(axis=0) >= self._threshold[likeliest]
        decisions.object_class[:] = np.where(reported, likeliest + 1, 0)


class Decision(LikeliestClass):
    """Posteriors to classes.

    Args:
        config: costs, and the frequency at the start.
        frequency: (4,) frequencies of the classes among proposals that the posteriors assume.

    Attributes:
        frequency: (4,) frequencies of the classes among the proposals of this stream, as estimated so far.
    """

    def __init__(self, config: DecisionConfig, frequency: Float64) -> None:
        super().__init__(config, frequency)
        self._assumed = frequency
        start = config.frequency
        self.frequency = frequency.copy() if start is None else np.array([1.0 - sum(start), *start])
        self._start_mass = START_PROPOSALS * self.frequency
        self._mass = np.zeros(N_CLASSES)
        self._kept = np.append(1.0, np.minimum(KEPT_FROM / self._threshold, 1.0))

    def decide(self, decisions: Decisions, evidence: Evidence, motion: Motion) -> None:
        """Write the class of every track; those with a proposal add to the frequency of the classes."""
        adapted = self.adapted(evidence.posterior.T.copy())
        weighed, objects = adapted.copy(), decisions.object_class.nonzero()[0]
        last = decisions.object_class[objects]
        weighed[last, objects] /= self._kept[last]
        self._report(decisions, weighed)
        self._learn(adapted.take(motion.observed.nonzero()[0], axis=1))

    def adapted(self, posterior: Float64) -> Float64:
        """(4, M) posteriors under the frequencies of the stream."""
        weighted = posterior * (self.frequency / self._assumed)[:, None]
        adapted: Float64 = weighted / weighted.sum(axis=0)
        return adapted

    def _learn(self, adapted: Float64) -> None:
        """The mean of the adapted posteriors (4, R), the frequency at the start counting as START_PROPOSALS."""
        self._mass += adapted.sum(axis=1)
        total = self._mass.sum()
        if total > MEMORY_PROPOSALS:
            self._mass *= MEMORY_PROPOSALS / total
        mass, assumed = (self._start_mass + self._mass).tolist(), self._assumed.tolist()
        n = sum(mass)  # lists are faster than arrays of four
        objects = [min(max(m / n, a), a * MAX_CHANGE) for m, a in zip(mass[1:], assumed[1:], strict=True)]
        frequency = [max(1.0 - sum(objects), MIN_BACKGROUND), *objects]
        self.frequency = np.array(frequency) / sum(frequency)
