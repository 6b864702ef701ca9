"""Tables IV and V, Figs. 9 and 14: average precision and curves, with and without tracking."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from modt.config import ProfileConfig
from modt_desk.experiments.catalogue.experiment import Chart, Experiment, Label
from modt_desk.experiments.catalogue.figures import OBJECTS, Figure, curves, precisions
from modt_desk.experiments.judged import Judged
from modt_desk.experiments.replays import NetworkReplay, Replay

DETECTION, TRACKING = "det_only", "with_trk"
"""Each view by itself; views fused along a track. The paper's names."""
MODES = {DETECTION: "conventional", TRACKING: "accurate"}


def replays_of(ideal: bool) -> Callable[[ProfileConfig], dict[Label, Replay]]:
    """With and without tracking."""

    def replays(config: ProfileConfig) -> dict[Label, Replay]:
        return {(name, None): NetworkReplay(config, mode, ideal=ideal) for name, mode in MODES.items()}

    return replays


def _precisions(outcomes: Mapping[Label, Judged]) -> Iterator[Figure]:
    for name in MODES:
        yield from precisions(outcomes[name, None], name)


def _curves(outcomes: Mapping[Label, Judged]) -> Iterator[Figure]:
    for name in MODES:
        yield from curves(outcomes[name, None], name)


_NOTE = "The ideal tracker takes segments as they are; the real one also splits and merges them by its tracks."
_CHARTS = tuple(Chart(name, "recall", "precision", (f"precision {name}",)) for name in OBJECTS)
TABLE_IV = Experiment(
    "table4",
    "Table IV: average precision, real detector, ideal tracker",
    replays_of(True),
    _precisions,
    note=_NOTE,
)
FIGURE_9 = Experiment(
    "fig9", "Fig. 9: precision over recall, real detector, ideal tracker", replays_of(True), _curves, _CHARTS
)
TABLE_V = Experiment(
    "table5", "Table V: average precision, real detector, real tracker", replays_of(False), _precisions
)
FIGURE_14 = Experiment(
    "fig14", "Fig. 14: precision over recall, real detector, real tracker", replays_of(False), _curves, _CHARTS
)
