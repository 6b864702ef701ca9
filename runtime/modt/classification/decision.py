"""The reported class of a track: what a missed object costs, and how frequent the classes are in this stream.

A posterior holds for the class frequencies that the model was trained to assume. Those of the stream are estimated
from the posteriors themselves (M. Saerens et al., "Adjusting the outputs of a classifier to new a priori
probabilities", Neural Computation 2002), slowly and within bounds: no object becomes rarer than the model assumes,
since the first of its class may yet come. Doubtful people count as background, since posteriors of what the model
has not learnt are not calibrated: vines that resemble people a little would make people frequent, and so be people.

Background that resembles people a little has a tail that resembles them more. Where a large share of the proposals
resembles them a little, as among vines, a posterior just above the threshold is of that tail. So people are then
rarer than the model assumes, and only what clearly is a person is reported.

An object is reported where its expected cost, if it were missed, exceeds that of a false one. A reported class is
kept down to `kept_probability`, since a posterior also falls while the object is half hidden. For this its posterior
is raised by the same ratio, so it is also preferred to other classes that are more probable by less than that.
"""

from __future__ import annotations

import numpy as np

from modt.class_sizes import IS_PERSON
from modt.classes import N_CLASSES, ObjectClass
from modt.classification.tuning import DecisionTuning
from modt.config import DecisionConfig
from modt.types import Bool, Decisions, Evidence, Float64, Motion


class LikeliestClass:
    """The likeliest object, where its posterior reaches its threshold. This class adapts and remembers nothing.

    Args:
        config: costs.
        frequency: (C,) frequencies of the classes among proposals that the posteriors assume; also an attribute.
    """

    def __init__(self, config: DecisionConfig, frequency: Float64) -> None:
        self.frequency = frequency
        self._threshold = 1.0 / (1.0 + np.array(config.missed_cost))

    def decide(self, decisions: Decisions, evidence: Evidence, motion: Motion) -> None:
        """Write the class of every track."""
        self._report(decisions, evidence.posterior.T)

    def _report(self, decisions: Decisions, weight: Float64) -> None:
        """Write the class of every track by the weights (C, M) of its classes."""
        likeliest = weight[1:].argmax(axis=0)
        is_reported = weight[1:].max(axis=0) >= self._threshold[likeliest]
        decisions.object_class[:] = np.where(is_reported, likeliest + 1, ObjectClass.BACKGROUND)


class Decision(LikeliestClass):
    """Posteriors to classes.

    Args:
        config: costs, and the frequency at the start.
        frequency: (C,) frequencies of the classes among proposals that the posteriors assume.
        tuning: memory and bounds of the frequency, and hysteresis of the reported class.

    Attributes:
        frequency: (C,) frequencies of the classes among the proposals of this stream, as estimated so far.
    """

    def __init__(self, config: DecisionConfig, frequency: Float64, tuning: DecisionTuning = DecisionTuning()) -> None:
        super().__init__(config, frequency)
        self._assumed = frequency
        self._tuning = tuning
        start = config.frequency
        self.frequency = frequency.copy() if start is None else np.array([1.0 - sum(start), *start])
        # Sums of the posteriors of proposals: as if seen before the start, and seen since then.
        self._start_mass = tuning.start_proposals * self.frequency
        self._mass = np.zeros(N_CLASSES)
        self._lookalikes = Lookalikes(tuning)
        # A reported class is kept down to this share of its threshold, and preferred to others by its inverse.
        self._kept_share = np.append(1.0, np.minimum(tuning.kept_probability / self._threshold, 1.0))

    def decide(self, decisions: Decisions, evidence: Evidence, motion: Motion) -> None:
        """Write the class of every track; those with a proposal add to the frequency of the classes."""
        posterior = evidence.posterior.T.copy()
        adapted = self.adapted(posterior)
        weight = adapted.copy()
        objects = decisions.object_class.nonzero()[0]
        last_class = decisions.object_class[objects]
        weight[last_class, objects] /= self._kept_share[last_class]
        self._report(decisions, weight)
        rows = motion.observed.nonzero()[0]
        is_doubtful = IS_PERSON[:, None] & (posterior < self._tuning.certain_probability)
        self._lookalikes.learn(posterior[IS_PERSON].sum(axis=0).take(rows))
        self._learn(adapted.take(rows, axis=1), is_doubtful.take(rows, axis=1))

    def adapted(self, posterior: Float64) -> Float64:
        """(C, M) posteriors under the frequencies of the stream."""
        ratio = self.frequency / self._assumed
        ratio[IS_PERSON] *= self._lookalikes.odds
        weighted = posterior * ratio[:, None]
        adapted: Float64 = weighted / weighted.sum(axis=0)
        return adapted

    def _learn(self, adapted: Float64, is_doubtful: Bool) -> None:
        """Add adapted posteriors (C, R), and estimate the frequency by the mean of all, within bounds.

        The share of a person who `is_doubtful` (C, R) counts as background.
        """
        mass = np.where(is_doubtful, 0.0, adapted).sum(axis=1)
        mass[ObjectClass.BACKGROUND] += adapted.shape[1] - mass.sum()
        self._mass += mass
        n_seen = self._mass.sum()
        if n_seen > self._tuning.memory_proposals:
            self._mass *= self._tuning.memory_proposals / n_seen
        total = (self._start_mass + self._mass).tolist()  # lists are faster than arrays of four
        n = sum(total)
        objects = [
            min(max(class_mass / n, assumed), assumed * self._tuning.max_frequency_ratio)
            for class_mass, assumed in zip(total[1:], self._assumed[1:].tolist(), strict=True)
        ]
        frequency = [max(1.0 - sum(objects), self._tuning.min_background_frequency), *objects]
        self.frequency = np.array(frequency) / sum(frequency)


class Lookalikes:
    """Proposals of the last seconds that resemble people a little.

    Args:
        tuning: what resembles a person, which share of it is usual, and the memory.

    Attributes:
        odds: factor of the odds of a person, 1 where the share is usual.
    """

    def __init__(self, tuning: DecisionTuning) -> None:
        self.odds = 1.0
        self._tuning = tuning
        self._n_seen = tuning.lookalike_start
        self._n_alike = 0.0

    def learn(self, person: Float64) -> None:
        """Add the proposals of a frame, given the posterior (R,) of a person of any class."""
        tuning = self._tuning
        self._n_seen += len(person)
        self._n_alike += np.count_nonzero((person > tuning.min_lookalike) & (person < tuning.max_lookalike))
        if self._n_seen > tuning.lookalike_memory:
            self._n_alike *= tuning.lookalike_memory / self._n_seen
            self._n_seen = tuning.lookalike_memory
        share = self._n_alike / self._n_seen
        # The tail is thinner than the share by about its square.
        self.odds = min(1.0, tuning.usual_lookalikes / share) ** 2 if share else 1.0
