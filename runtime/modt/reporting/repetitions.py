"""What several trials of the same modes add up to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from modt.reporting.comparison import Contender
from modt.reporting.gamma import Evidence
from modt.types import Float64


@dataclass(frozen=True, slots=True)
class Trial:
    """Every contender once through the stream."""

    contenders: Sequence[Contender]

    def __getitem__(self, name: str) -> Contender:
        return next(c for c in self.contenders if c.name == name)


def evidence(trials: Sequence[Trial], name: str) -> Evidence:
    """Of one mode: what it counts is the same each time, what it costs is the median over the trials [CPU s]."""
    cost: Float64 = np.median([trial[name].cpu_s() for trial in trials], axis=0)
    return Evidence(trials[0][name].counts(), cost)


def pooled(trials: Sequence[Trial], name: str) -> Evidence:
    """Of a mode whose load differs from trial to trial: frame by frame, one trial after another [CPU s]."""
    return Evidence(
        np.concatenate([trial[name].counts() for trial in trials]),
        np.concatenate([trial[name].cpu_s() for trial in trials]),
    )


def windows_of(trials: Sequence[Trial], name: str) -> list[dict[str, Any]]:
    """Windows of one mode over all trials."""
    return [line for trial in trials for line in trial[name].energy_lines]
