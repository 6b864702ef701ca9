"""The paper's tables and figures as experiments, in its order."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from modt.config import ProfileConfig
from modt.errors import MisuseError
from modt_evaluation.experiments.figures import (
    Estimate,
    Figure,
    ObjectLengths,
    curves,
    efficiencies,
    precisions,
    ratio,
    track_lengths,
)
from modt_evaluation.experiments.judged import Judged, LabelReplay, NetworkReplay, Replay

Label = tuple[str, float | None]
"""Variant, and the swept value."""
DETECTION = "det_only"
"""Each view by itself, by the paper's name."""
TRACKING = "with_trk"
"""Views fused along a track, by the paper's name."""
IDEAL = "ideal detector, ideal tracker"
ALPHAS = {alpha: {"point_change": (alpha,) * 4} for alpha in (k / 50 for k in range(26))}
"""Keys of fusion by alpha."""
START_FRAMES = {float(n): {"start_frame": n} for n in (1, 2, 3, 4, 5, 6, 8, 10, 15, 20, 30, 40, 60)}
"""Keys of fusion by the starting frame."""
RANGES_M = (10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0)
RANGE = "range of interest [m]"


@dataclass(frozen=True)
class Experiment:
    """Replays of a drive, and the figures that follow from them.

    Attributes:
        name: name on the command line.
        title: the table or figure of the paper, and what it shows.
        replays: function of the profile of a drive that returns replays by label.
        figures: function of the outcome of a replay (of one drive or several pooled) and the swept value.
        swept: name and unit of the value that is swept.
        scans: whether sweeps are needed, not labels alone.
        note: facts that a reader needs.
    """

    name: str
    title: str
    replays: Callable[[ProfileConfig], Mapping[Label, Replay]]
    figures: Callable[[Judged, float | None], Iterator[Figure]]
    swept: str = ""
    scans: bool = True
    note: str = ""


def _labels(config: ProfileConfig) -> dict[Label, Replay]:
    return {(IDEAL, None): LabelReplay()}


def _pair(config: ProfileConfig, ideal: bool) -> dict[Label, Replay]:
    modes = {DETECTION: "conventional", TRACKING: "accurate"}
    return {(name, None): NetworkReplay(config, mode, ideal=ideal) for name, mode in modes.items()}


def _fused(config: ProfileConfig, swept: Mapping[float, Mapping[str, Any]]) -> dict[Label, Replay]:
    """Views multiplied, as in the paper, with a key of fusion that is swept."""
    made: dict[Label, Replay] = {}
    for at, keys in swept.items():
        fusion = replace(config.fusion, rule="product", **keys)
        made[TRACKING, at] = NetworkReplay(replace(config, fusion=fusion), ideal=True)
    return made | {(DETECTION, None): NetworkReplay(config, "conventional", ideal=True)}


def _within(config: ProfileConfig, ideal: bool) -> dict[Label, Replay]:
    return {("accurate", range_m): NetworkReplay(config, ideal=ideal, range_m=range_m) for range_m in RANGES_M}


def _tracked(config: ProfileConfig) -> dict[Label, Replay]:
    return {(mode, None): NetworkReplay(config, mode) for mode in ("accurate", "efficient")}


def _ideal_lengths(judged: Judged, at: float | None) -> Iterator[Figure]:
    wanted = ObjectLengths.of(judged).wanted
    yield Figure(at, "objects", Estimate(len(wanted)))
    yield Figure(at, "N_go", ratio(wanted, np.ones(len(wanted))))


def _betas_of_labels(judged: Judged, at: float | None) -> Iterator[Figure]:
    for range_m in RANGES_M:
        wanted = ObjectLengths.of(judged.within(range_m)).wanted
        yield Figure(range_m, "beta", ratio(np.ones(len(wanted)), wanted))


def _swept(judged: Judged, at: float | None) -> Iterator[Figure]:
    yield from precisions(judged, at)
    if at is not None:
        yield from efficiencies(judged, at)


def _followed(judged: Judged, at: float | None) -> Iterator[Figure]:
    yield from track_lengths(judged, at)
    yield from efficiencies(judged, at)


_ALL = (
    Experiment(
        "table3",
        "Table III: N_go of the labels",
        _labels,
        _ideal_lengths,
        scans=False,
        note="Labelled frames an object: Car, Pedestrian, Cyclist; vans and sitting people left out.",
    ),
    Experiment(
        "fig8",
        "Fig. 8: beta against the range of interest, ideal detector, ideal tracker",
        _labels,
        _betas_of_labels,
        RANGE,
        scans=False,
        note="An object is classified once, when it first is within the range: beta is the inverse of N_go there.",
    ),
    Experiment(
        "table4",
        "Table IV: average precision, real detector, ideal tracker",
        partial(_pair, ideal=True),
        precisions,
        note="The ideal tracker takes segments as they are; the real one also splits and merges them by its tracks.",
    ),
    Experiment(
        "fig9",
        "Fig. 9: precision over recall, real detector, ideal tracker",
        partial(_pair, ideal=True),
        curves,
        "recall",
    ),
    Experiment(
        "fig10",
        "Fig. 10: average precision against alpha, real detector, ideal tracker",
        partial(_fused, swept=ALPHAS),
        _swept,
        "alpha",
        note="alpha: relative change of points by which a view of any class is independent (Equation 4).",
    ),
    Experiment(
        "fig11",
        "Fig. 11: average precision against the starting frame, real detector, ideal tracker",
        partial(_fused, swept=START_FRAMES),
        _swept,
        "starting frame",
        note="Age of a track from which views are fused.",
    ),
    Experiment(
        "fig12",
        "Fig. 12: beta against the range of interest, real detector, ideal tracker",
        partial(_within, ideal=True),
        efficiencies,
        RANGE,
        note="Proposals beyond the range are left out before tracking.",
    ),
    Experiment(
        "table5", "Table V: average precision, real detector, real tracker", partial(_pair, ideal=False), precisions
    ),
    Experiment(
        "fig14",
        "Fig. 14: precision over recall, real detector, real tracker",
        partial(_pair, ideal=False),
        curves,
        "recall",
    ),
    Experiment(
        "table6",
        "Table VI: performance of the real tracker",
        _tracked,
        _followed,
        note="N_go: frames followed / (objects + discontinuities), as `modt evaluate` has it.",
    ),
    Experiment(
        "fig13",
        "Fig. 13: beta against the range of interest, real detector, real tracker",
        partial(_within, ideal=False),
        efficiencies,
        RANGE,
        note="Proposals beyond the range are left out before tracking.",
    ),
)
EXPERIMENTS = {experiment.name: experiment for experiment in _ALL}
EVERY = "all"


def chosen(names: Sequence[str]) -> list[Experiment]:
    """Experiments by name, in their order here.

    Raises:
        MisuseError: an unknown name.
    """
    for name in names:
        if name not in EXPERIMENTS and name != EVERY:
            raise MisuseError(f"--experiment {name}", "unknown", f"use one of {', '.join((EVERY, *EXPERIMENTS))}")
    return [e for e in _ALL if EVERY in names or e.name in names]
