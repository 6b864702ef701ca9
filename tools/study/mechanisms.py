"""The mechanisms of segmentation, tracking and fusion that can be switched off.

A switch is a change of the configuration.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from modt.config import ProfileConfig

Switch = Callable[[ProfileConfig], ProfileConfig]


def values(mechanism: str, **changes: Any) -> Switch:
    """Values of a mechanism's configuration, such as "tracking.kdop"."""

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


_GROUND, _CLUSTERS, _PERSONS, _CARS = (
    f"segmentation.{name}" for name in ("ground", "clusters", "person_splitting", "car_merging")
)
_KDOP, _FILTER = "tracking.kdop", "tracking.filter"

MECHANISMS: dict[str, tuple[str, Switch]] = {
    "ground flanks": ("a surface is lowered to the median beside it", values(_GROUND, flank_m=100.0)),
    "height gap": ("neighbouring cells are joined if near in height", values(_CLUSTERS, max_gap_m=5.0)),
    "height gap by beams": ("that bound grows with the beam spacing", values(_CLUSTERS, max_gap_beams=0.0)),
    "parts of large clusters": ("kept from a finer grid", values(_CLUSTERS, min_part_top_m=5.0)),
    "large parts stand out": ("by height and points", values(_CLUSTERS, min_part_top_m=0.0, min_part_points=1)),
    "ground where nothing stands": ("flanks are none", values(_GROUND, flat_m=1.0, flat_slope=2.0)),
    "objects on one beam": ("kept if of many points", values(_CLUSTERS, min_line_points=1000)),
    "person splitting": ("people split off on the fine grid", values(_PERSONS, min_cluster_m=10.0)),
    "StripMerger": ("strips of a car merged", values(_CARS, min_points=1000)),
    "StripMerger leaves people": ("strips that may be people", values(_CARS, max_person_width_m=0.0)),
    "StripMerger bounds elevation": ("of strips", values(_CARS, min_gap_beams=-20.0, max_gap_beams=20.0)),
    "StripMerger ends near by": ("where cars are whole", values(_CARS, max_beams=200.0)),
    "view margin": ("points beyond a limited view", values("segmentation.view_margin", margin_m=0.0)),
    "few cells for headings": ("at most 32 (saves CPU)", values("segmentation.boxes", max_cells=10_000)),
    "Reunion": ("fragments stay with one track", values("tracking.fragments", min_coverage=1.0)),
    "ExpectedSplitting": ("objects split off what they touch", values("tracking.split", min_coverage=1.0)),
    "CarMerging": ("parts of known cars merged", values("tracking.merge", min_coverage=1.0)),
    "BackgroundMap": ("background is remembered", values("tracking.background_map", capacity=0)),
    "mean k-DOP": ("of the last frames", values("tracking", mean_kdop_decay=0.0)),
    "envelope decay": ("an extent not seen again shrinks", values("tracking", envelope_decay=1.0)),
    "envelope": ("known extent, not the last one", values("tracking", envelope_decay=0.0)),
    "established tracks": ("only those change proposals", values("tracking", min_hits=1)),
    "second matching": ("by coverage", values(_KDOP, min_coverage=1.0)),
    "jump of k-DOPs": ("in the gate", values(_KDOP, jump_sigma_m=0.0)),
    "cost by size": ("of an association", values(_KDOP, size_weight=0.0)),
    "cost by overlap": ("of an association", values(_KDOP, overlap_weight=0.0)),
    "cost by height": ("of an association", values(_KDOP, height_weight=0.0)),
    "cost by points": ("of an association", values(_KDOP, count_weight=0.0)),
    "zero-velocity update": ("near the rest position", values(_FILTER, stationary_sigma_mps=50.0)),
    "new rest position": ("of what stopped", values(_FILTER, stopped_mps=0.01)),
    "rest position follows": ("the track", values(_FILTER, rest_gain=0.0)),
    "mean of views": ("not their product", values("fusion", rule="product")),
    "probable objects": ("are classified", values("fusion", min_object_probability=0.0)),
    "adapted decision": ("class frequency of the stream, hysteresis", values("decision", rule="likeliest")),
    "reflectance": ("evidence, hdl-64e only", values("sensor", reflectance="none")),
}
"""What each is, and its switch."""
PAIRS = (
    ("StripMerger", "CarMerging"),
    ("StripMerger", "Reunion"),
    ("Reunion", "CarMerging"),
    ("StripMerger", "Reunion", "CarMerging"),
    ("person splitting", "ExpectedSplitting"),
    ("second matching", "Reunion"),
)
"""Mechanisms that repair the same thing."""
MECHANISMS |= {" + ".join(names): together(*names) for names in PAIRS}
