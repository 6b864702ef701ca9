import numpy as np
import pytest

from modt.classes import ObjectClass
from modt.classification.decision import Decision, LikeliestClass, Lookalikes
from modt.classification.tuning import DecisionTuning
from modt.config import DecisionConfig
from modt.types import NONE, Tracks

BACKGROUND = ObjectClass.BACKGROUND
PEDESTRIAN = ObjectClass.PEDESTRIAN
CYCLIST = ObjectClass.CYCLIST
ASSUMED = np.array([0.8, 0.1, 0.06, 0.04])


def tracks(*posteriors):
    table = Tracks.blank(len(posteriors))
    table.posterior[:] = np.reshape(posteriors, (-1, 4))
    table.proposal[:] = np.arange(len(posteriors))
    return table


@pytest.mark.parametrize(
    ("missed_cost", "posterior", "reported"),
    [
        ((1.0, 1.0, 1.0), [0.7, 0.0, 0.3, 0.0], BACKGROUND),
        ((1.0, 3.0, 1.0), [0.7, 0.0, 0.3, 0.0], PEDESTRIAN),
        ((1.0, 3.0, 1.0), [0.7, 0.3, 0.0, 0.0], BACKGROUND),
        ((9.0, 9.0, 9.0), [0.4, 0.0, 0.25, 0.35], CYCLIST),
    ],
)
def test_the_likelier_object_is_reported_where_missing_it_costs_more(missed_cost, posterior, reported):
    table = tracks(posterior)
    LikeliestClass(DecisionConfig(missed_cost=missed_cost), ASSUMED).decide(table, table, table)
    assert table.object_class.tolist() == [reported]


DOUBTED_ONCE = [[1 - walks, 0.0, walks, 0.0] for walks in (*[0.9] * 20, 0.26)]


@pytest.mark.parametrize(
    ("cost", "posteriors", "reported"),
    [
        (1.0, [[1 - car, car, 0.0, 0.0] for car in (0.6, 0.45, 0.41, 0.39, 0.45, 0.51)], [1, 1, 1, 0, 0, 1]),
        (1.0, [[0.1, 0.0, walks, 0.9 - walks] for walks in (0.6, 0.42, 0.39, 0.42)], [2, 2, 3, 3]),
        (1.0, DOUBTED_ONCE, [2] * 20 + [0]),
        (3.0, DOUBTED_ONCE, [2] * 20 + [2]),  # costly to miss
    ],
)
def test_the_reported_class_is_kept_until_another_one_is_clearly_likelier(cost, posteriors, reported):
    table = tracks(posteriors[0])
    decision = Decision(DecisionConfig(missed_cost=(cost,) * 3), ASSUMED)
    history = []
    for posterior in posteriors:
        table.posterior[:] = posterior
        decision.decide(table, table, table)
        history.append(table.object_class[0])
    assert history == reported


def stream(frequency, rng, n):
    """Posteriors, calibrated under ASSUMED, of proposals whose classes have another frequency."""
    true = rng.choice(4, n, p=frequency)
    feature = rng.normal(2.2 * np.eye(4)[true], 1.0)
    likelihood = np.exp(2.2 * feature) * ASSUMED
    return likelihood / likelihood.sum(axis=1, keepdims=True)


@pytest.mark.parametrize("frequency", [(0.5, 0.1, 0.3, 0.1), (0.6, 0.28, 0.07, 0.05), tuple(ASSUMED)])
def test_the_frequency_of_the_stream_is_learnt(frequency):
    rng = np.random.default_rng(1)
    decision = Decision(DecisionConfig(), ASSUMED, DecisionTuning(certain_probability=0.0))
    for _ in range(300):
        seen = tracks(*stream(frequency, rng, 60))
        decision.decide(seen, seen, seen)
    assert decision.frequency == pytest.approx(frequency, abs=0.06)
    assert np.abs(decision.frequency - frequency).max() <= max(0.05, np.abs(ASSUMED - frequency).max() / 2)


@pytest.mark.parametrize(("walks", "is_frequent"), [(0.95, True), (0.6, False)])
def test_doubtful_people_do_not_make_each_other_frequent(walks, is_frequent):
    decision = Decision(DecisionConfig(), ASSUMED)
    for _ in range(100):
        seen = tracks(*[[1 - walks, 0.0, walks, 0.0]] * 30, *[[1.0, 0.0, 0.0, 0.0]] * 30)
        decision.decide(seen, seen, seen)
    assert (decision.frequency[PEDESTRIAN] > 2 * ASSUMED[PEDESTRIAN]) == is_frequent
    assert is_frequent or decision.frequency == pytest.approx(ASSUMED)


def test_no_object_becomes_rarer_than_the_model_assumes_and_what_is_not_seen_teaches_nothing():
    rng = np.random.default_rng(1)
    decision = Decision(DecisionConfig(), ASSUMED, DecisionTuning(start_proposals=1))  # what is seen counts soon
    lost = tracks([0.0, 0.0, 1.0, 0.0])
    lost.proposal[:] = NONE
    decision.decide(lost, lost, lost)
    assert decision.frequency == pytest.approx(ASSUMED)
    for _ in range(100):
        seen = tracks(*stream((0.97, 0.01, 0.01, 0.01), rng, 60))
        decision.decide(seen, seen, seen)
    assert decision.frequency == pytest.approx(ASSUMED, abs=0.01)


@pytest.mark.parametrize(
    ("alike", "walks", "reported"), [(25, 0.6, BACKGROUND), (25, 0.95, PEDESTRIAN), (3, 0.6, PEDESTRIAN)]
)
def test_among_many_things_that_resemble_people_a_little_only_a_clear_person_is_reported(alike, walks, reported):
    decision = Decision(DecisionConfig(), ASSUMED)
    little = [[0.92, 0.0, 0.08, 0.0]] * alike
    plain = [[0.99, 0.005, 0.005, 0.0]] * (60 - alike)
    for _ in range(30):
        seen = tracks([1 - walks, 0.0, walks, 0.0], *little, *plain)
        decision.decide(seen, seen, seen)
    assert seen.object_class[0] == reported
    assert not seen.object_class[1:].any()


def test_lookalikes_are_forgotten():
    lookalikes = Lookalikes(DecisionTuning(lookalike_memory=500))
    for _ in range(20):
        lookalikes.learn(np.full(60, 0.1))
    assert lookalikes.odds < 0.1
    for _ in range(50):
        lookalikes.learn(np.zeros(60))
    assert lookalikes.odds == 1.0
