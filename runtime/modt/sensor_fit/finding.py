"""What a recording shows of its sensor: keys of a profile, each with its evidence."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from modt.config import ProfileConfig
from modt.types import Float32


@dataclass(frozen=True, slots=True)
class Recording:
    """Some sweeps of a sensor.

    Attributes:
        sweeps: (N, 4) points of each [m, sensor frame], without those that lie at the origin.
        stamps_s: time of each.
    """

    sweeps: Sequence[Float32]
    stamps_s: Sequence[float]


@dataclass(frozen=True, slots=True)
class Finding:
    """A value of a profile's key."""

    stage: str  # of the profile
    key: str  # of the stage
    value: Any  # of the key
    evidence: str  # what was measured, or why nothing could be
    sure: bool = True  # measured well; else to be checked by the user


Finder = Callable[[Recording, ProfileConfig], Iterable[Finding]]
"""Finds keys in a recording, given the profile that the finders before it have found."""


def apply(config: ProfileConfig, findings: Iterable[Finding]) -> ProfileConfig:
    """The profile with the values found."""
    for found in findings:
        stage = replace(getattr(config, found.stage), **{found.key: found.value})
        config = replace(config, **{found.stage: stage})
    return config
