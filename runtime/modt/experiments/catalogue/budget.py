"""Beyond the paper: what a budget of classifications buys."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from modt.config import ProfileConfig
from modt.experiments.catalogue.estimate import ratio
from modt.experiments.catalogue.experiment import Chart, Experiment, Label, changed
from modt.experiments.catalogue.figures import OBJECTS, Figure, TrackLives, latencies, precisions
from modt.experiments.judged import Judged
from modt.experiments.replays import NetworkReplay, Replay

BUDGETS = (0, 1, 2, 3, 4, 6, 8, 16)
ACCURATE, CONVENTIONAL = "accurate", "conventional, no budget"


def _replays(config: ProfileConfig) -> dict[Label, Replay]:
    swept: dict[Label, Replay] = {
        (ACCURATE, float(n)): NetworkReplay(changed(config, scheduler__calls_per_frame=n)) for n in BUDGETS
    }
    return swept | {(CONVENTIONAL, None): NetworkReplay(config, "conventional")}


def _figures(outcomes: Mapping[Label, Judged]) -> Iterator[Figure]:
    for (variant, at), judged in outcomes.items():
        yield from precisions(judged, variant, at)
        yield from latencies(judged, variant, at)
        tracks = TrackLives.of(judged)
        frames = np.full(len(tracks.calls), len(judged.frames) / max(len(tracks.calls), 1))
        yield Figure(variant, at, "calls a frame", ratio(tracks.calls, frames))
        yield Figure(variant, at, "points classified a frame", ratio(tracks.points, frames))


BUDGET = Experiment(
    "budget",
    "Budget of classifications a frame",
    _replays,
    _figures,
    (
        Chart(
            "average precision", "most calls a frame", "average precision", tuple(f"AP {name}" for name in OBJECTS)
        ),
        Chart("latency", "most calls a frame", "frames to a correct class", ("frames to a correct class",)),
        Chart("work", "most calls a frame", "points classified a frame", ("points classified a frame",)),
    ),
    note="The energy of classification is that of its points times what a point costs on the machine at hand: "
    "`modt-profile compare` measures it.",
)
