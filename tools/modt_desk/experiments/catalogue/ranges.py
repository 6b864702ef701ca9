"""Figs. 12 and 13: beta against the range of interest, real detector."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from modt.config import ProfileConfig
from modt_desk.experiments.catalogue.experiment import Chart, Experiment, Label, changed
from modt_desk.experiments.catalogue.figures import Figure, efficiencies
from modt_desk.experiments.catalogue.ideal_lives import RANGES_M
from modt_desk.experiments.judged import Judged
from modt_desk.experiments.replays import NetworkReplay, Replay

GATED, EVERY = "as configured", "every new track classified"
_UNGATED = {
    "fusion__min_object_probability": 0.0,
    "fusion__first_view_min_object_probability": 0.0,
    "tracking__background_map__capacity": 0,
}


def _replays_of(ideal: bool) -> Callable[[ProfileConfig], dict[Label, Replay]]:
    def replays(config: ProfileConfig) -> dict[Label, Replay]:
        variants = {GATED: config, EVERY: changed(config, **_UNGATED)}
        return {
            (name, range_m): NetworkReplay(made, ideal=ideal, range_m=range_m)
            for name, made in variants.items()
            for range_m in RANGES_M
        }

    return replays


def _figures(outcomes: Mapping[Label, Judged]) -> Iterator[Figure]:
    for (variant, range_m), judged in outcomes.items():
        yield from efficiencies(judged, variant, range_m)


_CHARTS = (
    Chart("all proposals", "range of interest [m]", "beta", ("beta",)),
    Chart("proposals of objects", "range of interest [m]", "beta", ("beta of objects",)),
)
_NOTE = (
    "Proposals beyond the range are left out before tracking. The gate by boxes and the map of background spare most "
    "calls as configured; without them every new track is classified, as in the paper, as far as the budget of a "
    "frame goes."
)
FIGURE_12 = Experiment(
    "fig12",
    "Fig. 12: beta against the range of interest, real detector, ideal tracker",
    _replays_of(True),
    _figures,
    _CHARTS,
    note=_NOTE,
)
FIGURE_13 = Experiment(
    "fig13",
    "Fig. 13: beta against the range of interest, real detector, real tracker",
    _replays_of(False),
    _figures,
    _CHARTS,
    note=_NOTE,
)
