from __future__ import annotations

import numpy as np
import pytest

from modt_desk.evaluation.rows import OBJECT, PROPOSAL, table
from modt_desk.experiments.catalogue.wander import FIGURE_15, parked
from modt_desk.experiments.judged import CALL, CENTRE, FRAME, Judged


def centres(id_: int, truth_x: list[float], mean_x: list[float]):
    """A car along x, its labels and the means of its points."""
    at = [[x, 0.0] for x in truth_x], [[x, 0.0] for x in mean_x]
    return table(CENTRE, len(truth_x), id=id_, frame=np.arange(len(truth_x)), truth=at[0], mean=at[1], box=at[0])


def test_cars_that_drive_do_not_count():
    rows = np.concatenate([centres(1, [5, 5.2, 5.1], [5, 5, 5]), centres(2, [5, 7, 9], [5, 7, 9])])
    assert [car["id"][0] for car in parked(rows)] == [1]


def test_wander_is_measured_from_the_mean_place_and_from_frame_to_frame():
    still = centres(1, [5, 5, 5, 5], [4, 6, 4, 6])
    tables = [np.zeros(1, FRAME), *(np.zeros(0, kind) for kind in (OBJECT, PROPOSAL, CALL))]
    figures = list(FIGURE_15.figures(Judged(*tables, still), "accurate", None))
    of_mean = {f.quantity: f.estimate.value for f in figures if f.variant.startswith("mean")}
    assert of_mean["rms from their mean [m]"] == pytest.approx(1.0)
    assert of_mean["step from frame to frame [m]"] == pytest.approx(2.0)
    assert [f.at for f in figures if f.quantity.startswith("distance [m], mean")] == [0, 1, 2, 3]
