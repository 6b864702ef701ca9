"""The mechanisms of odometry and fusion that can be switched off.

A switch is a change of the configuration.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from modt.config import ProfileConfig

Switch = Callable[[ProfileConfig], ProfileConfig]


def values(mechanism: str, **changes: Any) -> Switch:
    """Values of a mechanism's configuration, such as "odometry.landmarks"."""

    def changed(config: Any, path: list[str]) -> Any:
        inner = {path[0]: changed(getattr(config, path[0]), path[1:])} if path else changes
        return replace(config, **inner)

    return lambda profile: changed(profile, mechanism.split("."))


def together(*names: str) -> tuple[str, Switch]:
    """Entry of several mechanisms at once."""

    def switch(profile: ProfileConfig) -> ProfileConfig:
        for name in names:
            profile = MECHANISMS[name][1](profile)
        return profile

    return "together", switch


_REGISTRATION, _LANDMARKS = "odometry.registration", "odometry.landmarks"

MECHANISMS: dict[str, tuple[str, Switch]] = {
    "mean of views": ("not their product", values("fusion", rule="product")),
    "probable objects": ("are classified", values("fusion", min_object_probability=0.0)),
    "hysteresis": ("of the class that is said", values("decision", hysteresis=1.0)),
    "worth": (
        "order of calls; off: longest waiting first",
        values("scheduler.worth", uncertainty_weight=0.0, nearness_weight=0.0, novelty_weight=0.0),
    ),
    "reflectance": ("evidence, hdl-64e only", values("sensor", reflectance="none")),
    "landmarks": ("mean k-DOPs (no poses)", values(_LANDMARKS, min_frames=1000)),
    "young landmarks": ("say less (no poses)", values(_REGISTRATION, young_sigma_m=0.0)),
    "ends by range": ("say less (no poses)", values(_REGISTRATION, end_sigma_per_m=0.0)),
    "wider search": ("with few inliers (no poses)", values(_REGISTRATION, inlier_ratio=0.0, inlier_drop=0.0)),
    "inlier drop": ("the same, since the last frame (no poses)", values(_REGISTRATION, inlier_drop=0.0)),
    "turns at the outset": ("tried (no poses)", values(_REGISTRATION, initial_turn_rad=0.0)),
}
"""What each is, and its switch."""
PAIRS: tuple[tuple[str, ...], ...] = ()
"""Mechanisms that repair the same thing."""
MECHANISMS |= {" + ".join(names): together(*names) for names in PAIRS}
