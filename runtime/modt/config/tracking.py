"""Tracking of proposals (sections III-B and IV-A). Values without a source were settled on synthetic drives."""

from __future__ import annotations

from dataclasses import dataclass

from modt.config.base import StageConfig, choice, mechanism, number


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterConfig(StageConfig):
    """The extended Kalman filter (Equation 1)."""

    acceleration_sigma_mps2: float = number(2.0, 0.01, 50.0, "m/s2", "process noise of the speed")
    turn_sigma_radps: float = number(0.3, 0.001, 10.0, "rad/s", "process noise of the heading")
    initial_position_sigma_m: float = number(0.3, 0.01, 5.0, "m", "of the position of a new track")
    initial_speed_sigma_mps: float = number(8.0, 0.1, 50.0, "m/s", "of the speed of a new track")
    stationary_radius_m: float = number(0.5, 0.05, 5.0, "m", "a track this near to its rest position is stationary")
    stationary_sigma_mps: float | None = number(
        1.0, 0.01, 50.0, "m/s", "of the speed 0 that is observed of such a track; null: none is"
    )
    stopped_mps: float = number(0.5, 0.01, 5.0, "m/s", "a moving track slower than this has a new rest position")
    rest_gain: float = number(0.1, 0.0, 1.0, "", "weight of a new position in the rest position")


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperAssociationConfig(StageConfig):
    """The paper's association cost (section III-B); in effect with association: paper."""

    alpha: float = number(2.0, 0.0, 100.0, "", "weight of 1 - IoU, seen from above")
    beta: float = number(0.01, 0.0, 10.0, "", "reward of like numbers of points")
    gamma: float = number(0.1, 0.0, 10.0, "", "reward of like sizes")
    t_da: float = number(0.95, 0.0, 100.0, "", "highest cost of an association")


@dataclass(frozen=True, slots=True, kw_only=True)
class KdopAssociationConfig(StageConfig):
    """Association by k-DOPs; in effect with association: kdop."""

    max_cost: float = number(7.0, 0.1, 1000.0, "", "cost of leaving a track without a proposal")
    min_coverage: float = number(0.3, 0.0, 1.0, "", "overlap over the smaller, of a pair that changed its shape")
    jump_sigma_m: float = number(0.4, 0.0, 5.0, "m", "jumps of k-DOPs as parts of an object come into view and go")
    size_weight: float = number(2.0, 0.0, 100.0, "", "of the difference of log sizes")
    overlap_weight: float = number(3.0, 0.0, 100.0, "", "of 1 - IoU")
    height_weight: float = number(2.0, 0.0, 100.0, "1/m", "of the difference of heights")
    count_weight: float = number(0.5, 0.0, 100.0, "", "of the difference of log point numbers")
    position_sigma_m: float = number(0.1, 0.001, 5.0, "m", "of a measured position")


@dataclass(frozen=True, slots=True, kw_only=True)
class FragmentConfig(StageConfig):
    """One track for the fragments of one object."""

    min_coverage: float = number(
        0.6, 0.0, 1.0, "", "part of one that lies within what is known of the other; 1: none are reunited"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SplitConfig(StageConfig):
    """Objects split off what they touch, where their tracks expect them."""

    min_coverage: float = number(0.6, 0.0, 1.0, "", "part of the expected k-DOP that the larger proposal covers")
    longer_m: float = number(0.3, 0.0, 10.0, "m", "by which a proposal that holds something else exceeds the track")
    pad_m: float = number(0.2, 0.0, 2.0, "m", "around the expected k-DOP and above the expected top")
    min_points: int = number(8, 1, 1000, "", "of what is split off and of the rest")
    min_share: float = number(0.4, 0.0, 1.0, "", "of the points last seen that is split off")
    max_drop_m: float = number(0.4, 0.0, 5.0, "m", "of the top below the expected one")


@dataclass(frozen=True, slots=True, kw_only=True)
class MergeConfig(StageConfig):
    """Parts of a car merged where its track knows it whole."""

    min_coverage: float = number(0.7, 0.0, 1.0, "", "part of a piece within the known extent of the car")
    longer_m: float = number(0.3, 0.0, 10.0, "m", "by which the merged car may exceed its known extent")


@dataclass(frozen=True, slots=True, kw_only=True)
class BackgroundMapConfig(StageConfig):
    """Places of background at rest, whose class new proposals take over; in effect with association: kdop."""

    capacity: int = number(2048, 0, 100_000, "places", "of deleted tracks; 0: no class is taken over")
    min_coverage: float = number(0.6, 0.0, 1.0, "", "part of a new proposal that lies within the place")
    rise_m: float = number(0.5, 0.0, 10.0, "m", "by which a new proposal may rise above the place")


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackingConfig(StageConfig):
    """Filter, association, regrouping and life of a track."""

    association: str = choice("kdop", ("kdop", "paper"), "how proposals find their tracks")
    max_missed: int = number(
        8, 0, 100, "frames", "of sensor.period_s, unseen, before a track is deleted (N of a9 and a14)"
    )
    min_hits: int = number(4, 1, 1000, "frames", "observed, from which a track's velocity and class change proposals")
    envelope_decay: float = number(0.98, 0.0, 1.0, "", "kept a frame of an extent that is not seen again")
    mean_kdop_decay: float = number(0.8, 0.0, 1.0, "", "greatest weight of the past in a mean k-DOP")
    filter: FilterConfig = mechanism(FilterConfig)
    paper: PaperAssociationConfig = mechanism(PaperAssociationConfig)
    kdop: KdopAssociationConfig = mechanism(KdopAssociationConfig)
    fragments: FragmentConfig = mechanism(FragmentConfig)
    split: SplitConfig = mechanism(SplitConfig)
    merge: MergeConfig = mechanism(MergeConfig)
    background_map: BackgroundMapConfig = mechanism(BackgroundMapConfig)
