"""Several repetitions of the same modes, combined."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from modt.reporting.comparison import ModeRun
from modt.reporting.gamma import RunCosts
from modt.types import Float64

Repetition = dict[str, ModeRun]
"""One pass of every mode through the stream, by the name of the mode."""


def median_run(repetitions: Sequence[Repetition], name: str) -> RunCosts:
    """Counts of one mode, equal in all repetitions, and the median of its costs [CPU s]."""
    cost: Float64 = np.median([repetition[name].cpu_s() for repetition in repetitions], axis=0)
    return RunCosts(repetitions[0][name].counts(), cost)


def concatenated_run(repetitions: Sequence[Repetition], name: str) -> RunCosts:
    """Counts and costs [CPU s] of a mode whose load differs between repetitions, one repetition after another."""
    return RunCosts(
        np.concatenate([repetition[name].counts() for repetition in repetitions]),
        np.concatenate([repetition[name].cpu_s() for repetition in repetitions]),
    )


def windows_of(repetitions: Sequence[Repetition], name: str) -> list[dict[str, Any]]:
    """Windows of one mode over all repetitions."""
    return [line for repetition in repetitions for line in repetition[name].energy_lines]
