"""Beyond the paper: what a budget of classifications buys."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from modt.config import EnergyConfig, ProfileConfig
from modt.types import Float64
from modt_desk.experiments.catalogue.estimate import ratio
from modt_desk.experiments.catalogue.experiment import Chart, Experiment, Label, changed
from modt_desk.experiments.catalogue.figures import PRECISIONS, Figure, TrackLives, latencies, precisions
from modt_desk.experiments.judged import Judged
from modt_desk.experiments.replays import NetworkReplay, Replay

BUDGETS = (0, 1, 2, 3, 4, 6, 8, 16)
ACCURATE, CONVENTIONAL = "accurate", "conventional, no budget"
ENERGY = "energy of classification a frame [mJ]"


def _replays(config: ProfileConfig) -> dict[Label, Replay]:
    swept: dict[Label, Replay] = {
        (ACCURATE, float(n)): NetworkReplay(changed(config, scheduler__calls_per_frame=n)) for n in BUDGETS
    }
    return swept | {(CONVENTIONAL, None): NetworkReplay(config, "conventional")}


def _figures(judged: Judged, variant: str, at: float | None) -> Iterator[Figure]:
    yield from precisions(judged, variant, at)
    yield from latencies(judged, variant, at)
    tracks, frames = _tracks(judged)
    yield Figure(variant, at, "calls a frame", ratio(tracks.calls, frames))
    yield Figure(variant, at, "points classified a frame", ratio(tracks.points, frames))


def _energies(judged: Judged, variant: str, at: float | None, board: EnergyConfig) -> Iterator[Figure]:
    """By what a classification and a point cost: times would not be the same bytes twice."""
    if board.coefficients is None:
        return
    _, class_J, point_J = board.coefficients
    tracks, frames = _tracks(judged)
    yield Figure(variant, at, ENERGY, ratio(1e3 * (class_J * tracks.calls + point_J * tracks.points), frames))


def _tracks(judged: Judged) -> tuple[TrackLives, Float64]:
    """All tracks, and the share of the frames that each stands for."""
    tracks = TrackLives.of(judged)
    n = len(tracks.calls)
    return tracks, np.full(n, len(judged.frames) / max(n, 1))


BUDGET = Experiment(
    "budget",
    "Budget of classifications a frame",
    _replays,
    _figures,
    (
        Chart("average precision", "most calls a frame", "average precision", PRECISIONS),
        Chart("latency", "most calls a frame", "frames to a correct class", ("frames to a correct class",)),
        Chart("work", "most calls a frame", "points classified a frame", ("points classified a frame",)),
        Chart("energy", "most calls a frame", ENERGY, (ENERGY,)),
    ),
    note="Points with padding, as the network processes them. Energy above idling, where a calibration of the board "
    "and this network is given (`--calibration`): classifications and their points times what each costs.",
    energies=_energies,
)
