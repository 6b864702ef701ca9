"""Beyond the paper: associations, fusions and odometries side by side."""

from __future__ import annotations

from collections.abc import Iterator

from modt.config import ProfileConfig
from modt_desk.experiments.catalogue.experiment import Experiment, Label, changed
from modt_desk.experiments.catalogue.figures import Figure, alarms, efficiencies, lives, precisions
from modt_desk.experiments.judged import Judged
from modt_desk.experiments.replays import NetworkReplay, Replay


def _associations(config: ProfileConfig) -> dict[Label, Replay]:
    return {(name, None): NetworkReplay(changed(config, tracking__association=name)) for name in ("kdop", "paper")}


def _fusions(config: ProfileConfig) -> dict[Label, Replay]:
    modes: dict[Label, Replay] = {
        (f"mode {mode}", None): NetworkReplay(config, mode) for mode in ("conventional", "efficient", "accurate")
    }
    variants = {
        "accurate, views multiplied": changed(config, fusion__rule="product"),
        "accurate, every new track classified": changed(config, fusion__min_object_probability=0.0),
    }
    return modes | {(name, None): NetworkReplay(made) for name, made in variants.items()}


def _odometries(config: ProfileConfig) -> dict[Label, Replay]:
    names = {True: "poses of the drive", False: "registration against the tracks"}
    return {(name, None): NetworkReplay(config, poses=poses) for poses, name in names.items()}


def _figures(judged: Judged, variant: str, at: float | None) -> Iterator[Figure]:
    yield from precisions(judged, variant, at)
    yield from (f for f in lives(judged, variant, at) if f.quantity not in ("objects", "frames"))
    yield from efficiencies(judged, variant, at)
    yield from (f for f in alarms(judged, variant, at) if f.quantity.endswith("all"))


ASSOCIATION = Experiment("association", "Associations", _associations, _figures)
FUSION = Experiment("fusion", "Fusions", _fusions, _figures)
ODOMETRY = Experiment("odometry", "Odometries", _odometries, _figures)
