"""Fig. 15: how far the centres of parked cars wander in the world."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from modt.config import ProfileConfig
from modt.types import Float64
from modt_desk.evaluation.rows import Rows
from modt_desk.evaluation.truth import LEAST_FRAMES, STILL_M
from modt_desk.experiments.catalogue.estimate import Estimate, ratio
from modt_desk.experiments.catalogue.experiment import Chart, Experiment, Label
from modt_desk.experiments.catalogue.figures import Figure
from modt_desk.experiments.judged import Judged
from modt_desk.experiments.replays import NetworkReplay, Replay

CENTRES = {"mean": "mean of the points (the paper's)", "box": "centre of the box", "filter": "position of the track"}
MAX_DRAWN = 7
"""Cars whose distances are listed, those seen longest."""


def _replays(config: ProfileConfig) -> dict[Label, Replay]:
    return {("accurate", None): NetworkReplay(config)}


def parked(centres: Rows) -> Iterator[Rows]:
    """The rows of each parked car."""
    for car in np.unique(centres[["drive", "id"]]).tolist():
        rows = centres[(centres["drive"] == car[0]) & (centres["id"] == car[1])]
        if len(rows) >= LEAST_FRAMES and np.ptp(rows["truth"], axis=0).max() <= STILL_M:
            yield rows


def _figures(judged: Judged, variant: str, at: float | None) -> Iterator[Figure]:
    cars = list(parked(judged.centres))
    for column, name in CENTRES.items():
        square = [float(np.sum((car[column] - car[column].mean(axis=0)) ** 2)) for car in cars]
        jump = [np.hypot(*np.diff(car[column], axis=0).T) for car in cars]
        yield Figure(name, None, "cars", Estimate(len(cars)))
        yield Figure(name, None, "rms from their mean [m]", ratio(square, [len(car) for car in cars]).sqrt())
        yield Figure(
            name, None, "step from frame to frame [m]", ratio([s.sum() for s in jump], [len(s) for s in jump])
        )
    longest = sorted(cars, key=len, reverse=True)[:MAX_DRAWN]
    for car in longest if len(np.unique(judged.frames["drive"])) == 1 else ():
        for column, name in list(CENTRES.items())[::2]:
            distance: Float64 = np.hypot(*(car[column] - car["start"]).T)
            for frame, metres in zip(car["frame"].tolist(), distance.tolist(), strict=True):
                yield Figure(f"car {car['id'][0]}", frame, f"distance [m], {name}", Estimate(metres))


FIGURE_15 = Experiment(
    "fig15",
    "Fig. 15: how far the centres of parked cars wander",
    _replays,
    _figures,
    tuple(
        Chart(name, "frame", "distance from the start [m]", (f"distance [m], {name}",))
        for name in list(CENTRES.values())[::2]
    ),
    note="Parked: the labels stay within 1 m. The labels themselves wander by 0.1 m or so. Drives with poses only.",
)
