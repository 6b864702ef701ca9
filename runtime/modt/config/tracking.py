"""Tracking of proposals."""

from __future__ import annotations

from dataclasses import dataclass

from modt.config.base import StageConfig, choice, number


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackingConfig(StageConfig):
    """Filter, association and life of a track (sections III-B and IV-A)."""

    association: str = choice("robust", ("robust", "paper"), "how proposals find their tracks")
    alpha: float = number(2.0, 0.0, 100.0, "", "weight of 1 - IoU in the paper's cost")
    beta: float = number(0.01, 0.0, 10.0, "", "weight of the difference of point number")
    gamma: float = number(0.1, 0.0, 10.0, "", "weight of the difference of size")
    t_da: float = number(0.95, 0.0, 100.0, "", "highest cost of an association")
    max_missed: int = number(
        8,
        0,
        100,
        "frames",
        "without a proposal that end a track (N of a9, a14); half if seen but once or twice",
    )
    ask_from: int = number(1, 1, 100, "frames", "with a proposal before a class is asked for")
    position_sigma_m: float = number(0.3, 0.01, 5.0, "m", "of a measured position")
    acceleration_sigma_mps2: float = number(2.0, 0.01, 50.0, "m/s2", "process noise of the speed")
    turn_sigma_radps: float = number(0.3, 0.001, 10.0, "rad/s", "process noise of the heading")
    initial_speed_sigma_mps: float = number(5.0, 0.1, 50.0, "m/s", "of a new track")
