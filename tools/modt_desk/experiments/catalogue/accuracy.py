"""Tables IV and V, Figs. 9, 10, 11 and 14: average precision and curves, with and without tracking."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial

from modt.config import ProfileConfig
from modt_desk.experiments.catalogue.experiment import Chart, Experiment, Label, changed
from modt_desk.experiments.catalogue.figures import OBJECTS, PRECISIONS, Figure, curves, efficiencies, precisions
from modt_desk.experiments.judged import Judged
from modt_desk.experiments.replays import NetworkReplay, Replay

DETECTION, TRACKING = "det_only", "with_trk"
"""Each view by itself; views fused along a track. The paper's names."""
ALPHAS = tuple(k / 50 for k in range(26))
START_FRAMES = (1, 2, 3, 4, 5, 6, 8, 10, 15, 20, 30, 40, 60)


def _replays(config: ProfileConfig, ideal: bool) -> dict[Label, Replay]:
    modes = {DETECTION: "conventional", TRACKING: "accurate"}
    return {(name, None): NetworkReplay(config, mode, ideal=ideal) for name, mode in modes.items()}


_ideal, _real = partial(_replays, ideal=True), partial(_replays, ideal=False)


def _of_alpha(config: ProfileConfig) -> dict[Label, Replay]:
    multiplied = changed(config, fusion__rule="product")
    swept = {alpha: changed(multiplied, fusion__point_change=(alpha,) * 4) for alpha in ALPHAS}
    return _with_detection(config, swept)


def _of_start(config: ProfileConfig) -> dict[Label, Replay]:
    multiplied = changed(config, fusion__rule="product")
    return _with_detection(config, {float(n): changed(multiplied, fusion__start_frame=n) for n in START_FRAMES})


def _with_detection(config: ProfileConfig, swept: Mapping[float, ProfileConfig]) -> dict[Label, Replay]:
    tracked: dict[Label, Replay] = {(TRACKING, at): NetworkReplay(made, ideal=True) for at, made in swept.items()}
    return tracked | {(DETECTION, None): NetworkReplay(config, "conventional", ideal=True)}


def _swept(judged: Judged, variant: str, at: float | None) -> Iterator[Figure]:
    yield from precisions(judged, variant, at)
    if at is not None:
        yield from efficiencies(judged, variant, at)


_CURVES = tuple(Chart(name, "recall", "precision", (f"precision {name}",)) for name in OBJECTS)
TABLE_IV = Experiment(
    "table4",
    "Table IV: average precision, real detector, ideal tracker",
    _ideal,
    precisions,
    note="The ideal tracker takes segments as they are; the real one also splits and merges them by its tracks.",
)
FIGURE_9 = Experiment("fig9", "Fig. 9: precision over recall, real detector, ideal tracker", _ideal, curves, _CURVES)
FIGURE_10 = Experiment(
    "fig10",
    "Fig. 10: average precision against alpha, real detector, ideal tracker",
    _of_alpha,
    _swept,
    (
        Chart("average precision", "alpha", "average precision", PRECISIONS),
        Chart("beta", "alpha", "beta", ("beta", "beta of objects")),
    ),
    note="alpha: relative change of points (Equation 4) by which a view is independent, of every class; extents are "
    "left out of that rule here.",
)
FIGURE_11 = Experiment(
    "fig11",
    "Fig. 11: average precision against the starting frame, real detector, ideal tracker",
    _of_start,
    _swept,
    (Chart("average precision", "starting frame", "average precision", PRECISIONS),),
    note="Age of a track from which views are fused.",
)
TABLE_V = Experiment("table5", "Table V: average precision, real detector, real tracker", _real, precisions)
FIGURE_14 = Experiment("fig14", "Fig. 14: precision over recall, real detector, real tracker", _real, curves, _CURVES)
