"""What an experiment is."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from modt.config import EnergyConfig, ProfileConfig
from modt_desk.experiments.catalogue.figures import Figure
from modt_desk.experiments.judged import Judged
from modt_desk.experiments.replays import Replay

Label = tuple[str, float | None]
"""Variant, and the value that is swept."""


@dataclass(frozen=True, slots=True)
class Chart:
    """Figures of some quantities, drawn over the swept value."""

    title: str
    x_label: str
    y_label: str
    quantities: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Experiment:
    """Replays of a drive, and the figures that follow from them.

    Attributes:
        name: on the command line.
        title: the table or figure of the paper, and what it shows.
        replays: by label, given the profile of a drive.
        figures: of the outcome of a replay, of one drive or several pooled, and its label.
        charts: to draw.
        scans: whether sweeps are needed, not labels alone.
        note: what must be known to read it.
        energies: further figures, by a calibration of the board.
    """

    name: str
    title: str
    replays: Callable[[ProfileConfig], Mapping[Label, Replay]]
    figures: Callable[[Judged, str, float | None], Iterator[Figure]]
    charts: tuple[Chart, ...] = ()
    scans: bool = True
    note: str = ""
    energies: Callable[[Judged, str, float | None, EnergyConfig], Iterator[Figure]] = lambda *_: iter(())


def changed(config: ProfileConfig, **values: Any) -> ProfileConfig:
    """With values by the paths of their keys, dots written as two underscores: fusion__rule."""
    for path, value in values.items():
        config = _changed(config, path.split("__"), value)
    return config


def _changed(config: Any, path: list[str], value: Any) -> Any:
    name, *rest = path
    return replace(config, **{name: _changed(getattr(config, name), rest, value) if rest else value})
