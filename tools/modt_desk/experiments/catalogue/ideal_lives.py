"""Table III and Fig. 8: the ideal detector and tracker, that is the labels alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from modt.config import ProfileConfig
from modt_desk.experiments.catalogue.estimate import Estimate, ratio
from modt_desk.experiments.catalogue.experiment import Chart, Experiment, Label
from modt_desk.experiments.catalogue.figures import Figure, ObjectLives
from modt_desk.experiments.judged import Judged
from modt_desk.experiments.replays import LabelReplay, Replay

IDEAL = "ideal detector, ideal tracker"
RANGES_M = (10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0)


def _replays(config: ProfileConfig) -> dict[Label, Replay]:
    return {(IDEAL, None): LabelReplay()}


def _lives(outcomes: Mapping[Label, Judged]) -> Iterator[Figure]:
    found = ObjectLives.of(outcomes[IDEAL, None]).wanted
    yield Figure(IDEAL, None, "objects", Estimate(len(found)))
    yield Figure(IDEAL, None, "N_go", ratio(found, np.ones(len(found))))


def _efficiency(outcomes: Mapping[Label, Judged]) -> Iterator[Figure]:
    for range_m in RANGES_M:
        found = ObjectLives.of(outcomes[IDEAL, None].within(range_m)).wanted
        yield Figure(IDEAL, range_m, "beta", ratio(np.ones(len(found)), found))


TABLE_III = Experiment(
    "table3",
    "Table III: N_go of the labels",
    _replays,
    _lives,
    scans=False,
    note="Labelled frames an object: Car, Pedestrian, Cyclist; vans and sitting people left out.",
)
FIGURE_8 = Experiment(
    "fig8",
    "Fig. 8: beta against the range of interest, ideal detector, ideal tracker",
    _replays,
    _efficiency,
    (Chart("beta", "range of interest [m]", "beta", ("beta",)),),
    scans=False,
    note="An object is classified once, when it first is within the range; it is the inverse of N_go there.",
)
