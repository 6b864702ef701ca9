"""Tables III and VI: how long tracks live, by the labels alone and by the real tracker, and what it reports."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from modt.config import ProfileConfig
from modt_desk.experiments.catalogue.estimate import Estimate, ratio
from modt_desk.experiments.catalogue.experiment import Experiment, Label
from modt_desk.experiments.catalogue.figures import Figure, ObjectLives, TrackLives, alarms, efficiencies, lives
from modt_desk.experiments.judged import Judged
from modt_desk.experiments.replays import LabelReplay, NetworkReplay, Replay

IDEAL = "ideal detector, ideal tracker"


def labels(config: ProfileConfig) -> dict[Label, Replay]:
    """The labels alone."""
    return {(IDEAL, None): LabelReplay()}


def _tracked(config: ProfileConfig) -> dict[Label, Replay]:
    return {(mode, None): NetworkReplay(config, mode) for mode in ("accurate", "efficient")}


def _ideal_lives(judged: Judged, variant: str, at: float | None) -> Iterator[Figure]:
    wanted = ObjectLives.of(judged).wanted
    yield Figure(variant, at, "objects", Estimate(len(wanted)))
    yield Figure(variant, at, "N_go", ratio(wanted, np.ones(len(wanted))))


def _others(judged: Judged, variant: str, at: float | None) -> Iterator[Figure]:
    tracks = TrackLives.of(judged)
    for name, which in (("objects", tracks.on_object), ("background", ~tracks.on_object)):
        frames = tracks.frames[which]
        yield Figure(variant, at, f"N_go of tracks on {name}", ratio(frames, frames > 0))
    yield from alarms(judged, variant, at)
    yield from efficiencies(judged, variant, at)


TABLE_III = Experiment(
    "table3",
    "Table III: N_go of the labels",
    labels,
    _ideal_lives,
    scans=False,
    note="Labelled frames an object: Car, Pedestrian, Cyclist; vans and sitting people left out.",
)
TABLE_VI = Experiment(
    "table6",
    "Table VI: performance of the real tracker",
    _tracked,
    lives,
    note="N_go: frames followed / (objects + discontinuities), as `modt evaluate` has it.",
)
ALARMS = Experiment("alarms", "False alarms, and life of the tracks on objects and on background", _tracked, _others)
