"""Figs. 8, 12 and 13: beta against the range of interest."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from modt.config import ProfileConfig
from modt_desk.experiments.catalogue.estimate import ratio
from modt_desk.experiments.catalogue.experiment import Chart, Experiment, Label, changed
from modt_desk.experiments.catalogue.figures import Figure, ObjectLives, efficiencies
from modt_desk.experiments.catalogue.lives import labels
from modt_desk.experiments.judged import Judged
from modt_desk.experiments.replays import NetworkReplay, Replay

RANGES_M = (10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0)
GATED, EVERY = "as configured", "every new track classified"
_UNGATED = {
    "fusion__min_object_probability": 0.0,
    "tracking__background_map__capacity": 0,
}


def _replays(config: ProfileConfig, ideal: bool) -> dict[Label, Replay]:
    variants = {GATED: config, EVERY: changed(config, **_UNGATED)}
    return {
        (name, range_m): NetworkReplay(made, ideal=ideal, range_m=range_m)
        for name, made in variants.items()
        for range_m in RANGES_M
    }


def _of_labels(judged: Judged, variant: str, at: float | None) -> Iterator[Figure]:
    for range_m in RANGES_M:
        wanted = ObjectLives.of(judged.within(range_m)).wanted
        yield Figure(variant, range_m, "beta", ratio(np.ones(len(wanted)), wanted))


_CHARTS = (
    Chart("all proposals", "range of interest [m]", "beta", ("beta",)),
    Chart("proposals of objects", "range of interest [m]", "beta", ("beta of objects",)),
)
_NOTE = (
    "Proposals beyond the range are left out before tracking. The gate by boxes and the map of background spare most "
    "calls as configured; without them every new track is classified, as in the paper, as far as the budget of a "
    "frame goes."
)
FIGURE_8 = Experiment(
    "fig8",
    "Fig. 8: beta against the range of interest, ideal detector, ideal tracker",
    labels,
    _of_labels,
    (Chart("beta", "range of interest [m]", "beta", ("beta",)),),
    scans=False,
    note="An object is classified once, when it first is within the range; it is the inverse of N_go there.",
)
FIGURE_12 = Experiment(
    "fig12",
    "Fig. 12: beta against the range of interest, real detector, ideal tracker",
    partial(_replays, ideal=True),
    efficiencies,
    _CHARTS,
    note=_NOTE,
)
FIGURE_13 = Experiment(
    "fig13",
    "Fig. 13: beta against the range of interest, real detector, real tracker",
    partial(_replays, ideal=False),
    efficiencies,
    _CHARTS,
    note=_NOTE,
)
