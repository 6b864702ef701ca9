"""Table VI: the real tracker; and what else tells how it does."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from modt.config import ProfileConfig
from modt_desk.experiments.catalogue.estimate import ratio
from modt_desk.experiments.catalogue.experiment import Experiment, Label
from modt_desk.experiments.catalogue.figures import Figure, TrackLives, alarms, efficiencies, lives
from modt_desk.experiments.judged import Judged
from modt_desk.experiments.replays import NetworkReplay, Replay

REAL = "real detector, real tracker"


def _replays(config: ProfileConfig) -> dict[Label, Replay]:
    return {(mode, None): NetworkReplay(config, mode) for mode in ("accurate", "efficient")}


def _tracks(outcomes: Mapping[Label, Judged]) -> Iterator[Figure]:
    for (mode, _), judged in outcomes.items():
        yield from lives(judged, mode)


def _others(outcomes: Mapping[Label, Judged]) -> Iterator[Figure]:
    for (mode, _), judged in outcomes.items():
        tracks = TrackLives.of(judged)
        for name, which in (("objects", tracks.on_object), ("background", ~tracks.on_object)):
            frames = tracks.frames[which]
            yield Figure(mode, None, f"N_go of tracks on {name}", ratio(frames, frames > 0))
        yield from alarms(judged, mode)
        yield from efficiencies(judged, mode)


TABLE_VI = Experiment(
    "table6",
    "Table VI: performance of the real tracker",
    _replays,
    _tracks,
    note="N_go: frames followed / (objects + discontinuities), as `modt evaluate` has it.",
)
ALARMS = Experiment("alarms", "False alarms, and life of the tracks on objects and on background", _replays, _others)
