"""All experiments by name, in the order of the paper."""

from __future__ import annotations

from collections.abc import Sequence

from modt.errors import MisuseError
from modt_desk.experiments.catalogue.accuracy import FIGURE_9, FIGURE_10, FIGURE_11, FIGURE_14, TABLE_IV, TABLE_V
from modt_desk.experiments.catalogue.budget import BUDGET
from modt_desk.experiments.catalogue.experiment import Experiment
from modt_desk.experiments.catalogue.lives import ALARMS, TABLE_III, TABLE_VI
from modt_desk.experiments.catalogue.ranges import FIGURE_8, FIGURE_12, FIGURE_13
from modt_desk.experiments.catalogue.variants import ASSOCIATION, FUSION, ODOMETRY
from modt_desk.experiments.catalogue.wander import FIGURE_15

_ALL = (
    *(TABLE_III, FIGURE_8, TABLE_IV, FIGURE_9, FIGURE_10, FIGURE_11, FIGURE_12, TABLE_V, FIGURE_14),
    *(TABLE_VI, FIGURE_13, FIGURE_15, ALARMS, BUDGET, ASSOCIATION, FUSION, ODOMETRY),
)
EXPERIMENTS = {experiment.name: experiment for experiment in _ALL}
"""By name."""
EVERY = "all"


def chosen(names: Sequence[str]) -> list[Experiment]:
    """Experiments by name, in their order here.

    Raises:
        MisuseError: an unknown name.
    """
    for name in names:
        if name not in EXPERIMENTS and name != EVERY:
            raise MisuseError(f"--experiment {name}", "unknown", f"use one of {', '.join((EVERY, *EXPERIMENTS))}")
    return [e for e in _ALL if EVERY in names or e.name in names]
