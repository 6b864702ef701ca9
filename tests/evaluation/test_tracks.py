import sys

import numpy as np
import pytest
from modt.evaluation.tracks import SIMILARITIES, Labelled, evaluate

from modt.errors import MisuseError


def car(x):
    return [x, 0.0, 0.0, 4.0, 2.0, 1.5, 0.0]


def frames(ids, shift=0.0, n=10):
    return [
        Labelled(np.array(ids(i)), np.array([car(10.0 * k + shift) for k in range(len(ids(i)))])) for i in range(n)
    ]


def test_what_is_right_scores_full():
    truth = frames(lambda i: [5, 9])
    scores = evaluate([(truth, frames(lambda i: [1, 0]))])
    assert scores["HOTA"] == scores["MOTA"] == scores["IDF1"] == pytest.approx(100)
    assert scores["switches"] == 0


def test_a_switch_costs_association_only():
    truth = frames(lambda i: [5])
    scores = evaluate([(truth, frames(lambda i: [1 if i < 5 else 2]))])
    assert scores["switches"] == 1
    assert scores["DetA"] == pytest.approx(100)
    assert scores["AssA"] == pytest.approx(50)
    assert scores["MOTA"] == pytest.approx(90)


@pytest.mark.parametrize("name", SIMILARITIES)
def test_boxes_that_are_off_cost_detection(name):
    scores = evaluate([(frames(lambda i: [5]), frames(lambda i: [5], shift=1.0))], SIMILARITIES[name])
    assert 0 < scores["DetA"] < 80  # intersection over union 3 / 5
    assert scores["MOTA"] == pytest.approx(100)


def test_sequences_add_up_and_empty_ones_count_nothing():
    nothing = [Labelled(np.zeros(0, np.int64), np.zeros((0, 7)))] * 10
    truth = frames(lambda i: [5])
    assert evaluate([(truth, truth), (nothing, nothing)])["HOTA"] == pytest.approx(100)
    assert evaluate([(truth, nothing)])["MOTA"] == pytest.approx(0)
    assert evaluate([(nothing, nothing)]) == {}


def test_the_extra_is_named_where_it_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "trackeval.metrics", None)
    with pytest.raises(MisuseError, match=r"modt\[evaluate\]"):
        evaluate([])
