"""Figs. 10 and 11: average precision against alpha and against the starting frame, ideal tracker."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from modt.config import ProfileConfig
from modt_desk.experiments.catalogue.accuracy import DETECTION, TRACKING
from modt_desk.experiments.catalogue.experiment import Chart, Experiment, Label, changed
from modt_desk.experiments.catalogue.figures import OBJECTS, Figure, efficiencies, precisions
from modt_desk.experiments.judged import Judged
from modt_desk.experiments.replays import NetworkReplay, Replay

ALPHAS = tuple(k / 50 for k in range(26))
BY_POINTS_ALONE = 10.0
"""A change of extent that makes no view independent."""
_PRECISIONS = tuple(f"AP {name}" for name in OBJECTS)
START_FRAMES = (1, 2, 3, 4, 5, 6, 8, 10, 15, 20, 30, 40, 60)


def _of_alpha(config: ProfileConfig) -> dict[Label, Replay]:
    swept = {
        alpha: changed(config, fusion__point_change=(alpha,) * 4, fusion__extent_change=BY_POINTS_ALONE)
        for alpha in ALPHAS
    }
    return _with_detection(config, swept)


def _of_start(config: ProfileConfig) -> dict[Label, Replay]:
    return _with_detection(config, {float(n): changed(config, fusion__start_frame=n) for n in START_FRAMES})


def _with_detection(config: ProfileConfig, swept: Mapping[float, ProfileConfig]) -> dict[Label, Replay]:
    tracked: dict[Label, Replay] = {(TRACKING, at): NetworkReplay(made, ideal=True) for at, made in swept.items()}
    return tracked | {(DETECTION, None): NetworkReplay(config, "conventional", ideal=True)}


def _figures(outcomes: Mapping[Label, Judged]) -> Iterator[Figure]:
    for (variant, at), judged in outcomes.items():
        yield from precisions(judged, variant, at)
        if at is not None:
            yield from efficiencies(judged, variant, at)


FIGURE_10 = Experiment(
    "fig10",
    "Fig. 10: average precision against alpha, real detector, ideal tracker",
    _of_alpha,
    _figures,
    (
        Chart("average precision", "alpha", "average precision", _PRECISIONS),
        Chart("beta", "alpha", "beta", ("beta", "beta of objects")),
    ),
    note="alpha: relative change of points (Equation 4) by which a view is independent, of every class; extents are "
    "left out of that rule here.",
)
FIGURE_11 = Experiment(
    "fig11",
    "Fig. 11: average precision against the starting frame, real detector, ideal tracker",
    _of_start,
    _figures,
    (Chart("average precision", "starting frame", "average precision", _PRECISIONS),),
    note="Age of a track from which views are fused.",
)
