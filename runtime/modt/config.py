"""Configuration: one frozen dataclass a stage, every value bounded and checked as it is made."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any

from modt.errors import MisuseError


class ValueRangeError(MisuseError):
    """A configuration value of the wrong type or out of its range; key says which."""

    def __init__(self, key: str, cause: str, remedy: str) -> None:
        super().__init__(key, cause, remedy)
        self.key = key


def _number(default: float | None, low: float, high: float, unit: str, meaning: str) -> Any:
    return field(default=default, metadata={"low": low, "high": high, "unit": unit, "meaning": meaning})


def _choice(default: str, options: tuple[str, ...], meaning: str) -> Any:
    return field(default=default, metadata={"options": options, "meaning": meaning})


def _per_class(car: float, pedestrian: float, cyclist: float, low: float, high: float, meaning: str) -> Any:
    return field(
        default=(car, pedestrian, cyclist),
        metadata={"low": low, "high": high, "length": 3, "meaning": meaning},
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class StageConfig:
    """Base of every stage's configuration: checks each value against its declared bounds.

    Raises:
        ValueRangeError: a value is not of its kind or out of range.
    """

    def __post_init__(self) -> None:
        for f in fields(self):
            _check(f.name, getattr(self, f.name), f.type, dict(f.metadata))


def _check(key: str, value: object, kind: object, bounds: dict[str, Any]) -> None:
    optional = "None" in str(kind)
    if value is None and optional:
        return
    if "options" in bounds:
        if value not in bounds["options"]:
            raise ValueRangeError(key, f"{value!r} is unknown", f"use one of {', '.join(bounds['options'])}")
        return
    if str(kind) == "bool":
        if not isinstance(value, bool):
            raise ValueRangeError(key, f"{value!r} is no truth value", "use true or false")
        return
    if str(kind) == "str":
        if not isinstance(value, str):
            raise ValueRangeError(key, f"{value!r} is no text", "write a name")
        return
    numbers = value if "length" in bounds and isinstance(value, tuple) else (value,)
    whole = str(kind).startswith("int")
    span = f"{'a whole number' if whole else 'a number'} from {bounds['low']:g} to {bounds['high']:g}"
    if "length" in bounds:
        span = f"{bounds['length']} values, each {span}"
        if len(numbers) != bounds["length"]:
            raise ValueRangeError(key, f"{value!r} does not fit", f"give {span}")
    unit = f" {bounds['unit']}" if bounds.get("unit") else ""
    for number in numbers:
        numeric = isinstance(number, int) if whole else isinstance(number, int | float)
        if isinstance(number, bool) or not numeric:
            raise ValueRangeError(
                key, f"{value!r} is not {'a whole number' if whole else 'a number'}", f"give {span}{unit}"
            )
        if not bounds["low"] <= number <= bounds["high"]:
            raise ValueRangeError(key, f"{number!r} is out of range", f"give {span}{unit}")


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorConfig(StageConfig):
    """The sensor as segmentation sees it."""

    height_m: float | None = _number(1.73, 0.05, 5.0, "m", "above the ground; none: estimated from the stream")
    min_range_m: float = _number(2.0, 0.0, 20.0, "m", "nearer points belong to the robot itself")
    max_range_m: float = _number(80.0, 1.0, 400.0, "m", "farther points are left out")
    elevation_step_deg: float = _number(0.42, 0.01, 10.0, "deg", "between neighbouring beams, typical")
    azimuth_step_deg: float = _number(0.17, 0.01, 10.0, "deg", "between neighbouring returns of a beam")
    period_s: float = _number(0.1, 0.001, 10.0, "s", "of a sweep, where the stream has no stamps")
    reflectance: str = _choice(
        "none", ("none", "hdl-64e"), "on whose scale; models use that which they learnt from; none: not looked at"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmentationConfig(StageConfig):
    """Ground, clusters and the sizes of what can be an object (section III-A)."""

    max_slope_deg: float = _number(12.0, 0.5, 45.0, "deg", "of the ground")
    clearance_m: float = _number(0.25, 0.02, 1.0, "m", "above ground, from where on points make objects")
    max_height_m: float = _number(2.6, 0.3, 20.0, "m", "above ground; what hangs higher joins nothing")
    cell_m: float = _number(0.105, 0.01, 2.0, "m", "side of a cell at 10 m; grows as the square root of range")
    min_points: int = _number(5, 1, 1000, "", "of a proposal")
    max_extent_m: float = _number(13.0, 0.5, 50.0, "m", "longest side of a proposal")
    min_height_m: float = _number(0.2, 0.0, 3.0, "m", "lowest proposal")


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackingConfig(StageConfig):
    """Filter, association and life of a track (sections III-B and IV-A)."""

    association: str = _choice("robust", ("robust", "paper"), "how proposals find their tracks")
    alpha: float = _number(2.0, 0.0, 100.0, "", "weight of 1 - IoU in the paper's cost")
    beta: float = _number(0.01, 0.0, 10.0, "", "weight of the difference of point number")
    gamma: float = _number(0.1, 0.0, 10.0, "", "weight of the difference of size")
    t_da: float = _number(0.95, 0.0, 100.0, "", "highest cost of an association")
    max_missed: int = _number(
        8,
        0,
        100,
        "frames",
        "without a proposal that end a track (N of a9, a14); half if seen but once or twice",
    )
    ask_from: int = _number(1, 1, 100, "frames", "with a proposal before a class is asked for")
    position_sigma_m: float = _number(0.3, 0.01, 5.0, "m", "of a measured position")
    acceleration_sigma_mps2: float = _number(2.0, 0.01, 50.0, "m/s2", "process noise of the speed")
    turn_sigma_radps: float = _number(0.3, 0.001, 10.0, "rad/s", "process noise of the heading")
    initial_speed_sigma_mps: float = _number(5.0, 0.1, 50.0, "m/s", "of a new track")


@dataclass(frozen=True, slots=True, kw_only=True)
class BoxTrackingConfig(StageConfig):
    """Tracking of whole boxes that another detector has found, one class at a time."""

    strong_score: float = _number(
        0.0, -1e3, 1e3, "", "detections of this score begin a track; weaker ones continue one"
    )
    sure: float = _number(6.5, -1e3, 1e3, "", "confidence from which a track is reported")
    range_bonus_per_m: float = _number(0.1, 0.0, 10.0, "1/m", "what a detection's confidence gains with range")
    age_bonus: float = _number(0.5, 0.0, 10.0, "", "what a track's confidence gains with the logarithm of its age")
    score_gain: float = _number(0.5, 0.0, 1.0, "", "least weight of a new detection in the confidence")
    max_missed: int = _number(8, 0, 100, "frames", "without a detection before a track is deleted")
    report_missed: int = _number(0, 0, 100, "frames", "for which a track is reported where it is predicted")
    gate: float = _number(13.8, 0.1, 1000.0, "", "squared Mahalanobis distance of an association at most")
    overlap: float = _number(0.7, 0.0, 2.0, "", "part of the length by which a centre may be off besides")
    position_sigma_m: float = _number(0.2, 0.01, 5.0, "m", "of a detected centre of score zero")
    score_scale: float = _number(10.0, 0.1, 1e6, "", "rise of the score that makes a centre e times as exact")
    acceleration_sigma_mps2: float = _number(10.0, 0.01, 50.0, "m/s2", "process noise, the sensor's own included")
    initial_speed_sigma_mps: float = _number(20.0, 0.1, 50.0, "m/s", "of a new track, along each axis")
    smoothing: float = _number(0.3, 0.0, 1.0, "", "least weight of a new measurement of the size")
    height_gain: float = _number(0.7, 0.0, 1.0, "", "weight of a new measurement of the height")
    turn_gain: float = _number(0.7, 0.0, 1.0, "", "weight of a new measurement of the heading")


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassificationConfig(StageConfig):
    """The network and how its input is made (section V-A)."""

    model: str = field(default="pointnet-kitti", metadata={"meaning": "name in models/ or path of an .onnx file"})
    max_points: int = _number(128, 8, 4096, "", "of a proposal handed to the network")
    batch: int = _number(8, 1, 256, "", "proposals of one network call at most")


@dataclass(frozen=True, slots=True, kw_only=True)
class SchedulerConfig(StageConfig):
    """What one frame may spend on classification; none: no bound."""

    calls_per_frame: int | None = _number(16, 0, 10000, "", "proposals classified")
    cpu_ms_per_frame: float | None = _number(None, 0.0, 10000.0, "ms", "CPU time by the measured cost model")
    energy_mJ_per_frame: float | None = _number(None, 0.0, 100000.0, "mJ", "drawn beyond idle during that time")


@dataclass(frozen=True, slots=True, kw_only=True)
class FusionConfig(StageConfig):
    """Which views are independent, and when a class is settled (section V-C, Figs. 10 and 11)."""

    threshold: float = _number(0.9, 0.25, 1.0, "", "posterior at which an object's class is fixed")
    background_threshold: float = _number(0.6, 0.25, 1.0, "", "that of background, were all classes as common")
    view_weight: float = _number(1.0, 0.0, 1.0, "", "share of a further view's evidence; 1: as if independent")
    alpha: tuple[float, float, float] = _per_class(
        0.2, 0.16, 0.22, 0.0, 10.0, "change of points of car, pedestrian, cyclist"
    )
    background_alpha: float = _number(0.5, 0.0, 10.0, "", "the same, of what looks like background")
    prior: tuple[float, float, float] = _per_class(
        0.08, 0.02, 0.02, 0.0, 0.33, "share of car, pedestrian, cyclist among proposals"
    )
    likely: float = _number(0.01, 0.0, 1.0, "", "probability of an object, by its box, from which it is classified")
    likely_once: float = _number(0.1, 0.0, 1.0, "", "the same where the first view is the only one (efficient)")
    once_from: int = _number(1, 1, 1000, "frames", "with a proposal, before that only view is taken")
    likely_again: float = _number(0.1, 0.0, 1.0, "", "the same of what is settled, or took its class over")
    box_weight: float = _number(0.75, 0.0, 1.0, "", "say of a box that has changed since the view fused last")
    slip: float = _number(0.1, 0.0, 1.0, "", "probability that a track's proposal is something else for the moment")
    bearing_deg: float = _number(40.0, 0.0, 180.0, "deg", "change of view that makes it independent")
    range_ratio: float = _number(0.4, 0.0, 10.0, "", "change of distance that makes it independent")
    extent_ratio: float = _number(0.6, 0.0, 10.0, "", "change of size that makes it independent")
    reopen_ratio: float | None = _number(
        1.5, 1.0, 1000.0, "", "times the points, and five more, that raise doubt; none: never"
    )
    reopen_points: int = _number(400, 0, 10000, "", "a class settled from so many is never doubted")
    start_frame: int = _number(5, 1, 1000, "frames", "age of a track from which views are fused")


@dataclass(frozen=True, slots=True, kw_only=True)
class EnergyConfig(StageConfig):
    """The board: what it draws, assumed where nothing can be measured, and what a calibration found.

    The coefficients are of one window fit: energy = idle_W x time + seg_J x segmentations + class_J x
    classifications + point_J x points classified.
    """

    board: str = field(default="unknown", metadata={"meaning": "what the figures are of"})
    idle_W: float = _number(3.0, 0.0, 1000.0, "W", "drawn while the process waits")
    busy_W: float = _number(7.0, 0.0, 1000.0, "W", "drawn while it computes on one core")
    meter: str = field(default="none", metadata={"meaning": "that the coefficients were fitted with"})
    seg_J: float | None = _number(None, -1000.0, 1000.0, "J", "of one segmentation")
    class_J: float | None = _number(None, -1000.0, 1000.0, "J", "of one classification")
    point_J: float | None = _number(None, -1000.0, 1000.0, "J", "of one point classified")

    @property
    def active_W(self) -> float:
        """Power of one busy core beyond idle [W], that is mJ a ms."""
        return self.busy_W - self.idle_W

    @property
    def coefficients(self) -> tuple[float, float, float] | None:
        """Those of a calibration [J], None unless there are all three."""
        if self.seg_J is None or self.class_J is None or self.point_J is None:
            return None
        return self.seg_J, self.class_J, self.point_J


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryConfig(StageConfig):
    """Poses that come in by a socket."""

    max_age_s: float = _number(0.3, 0.001, 10.0, "s", "from a pose, beyond which it says nothing")
    max_ahead_s: float = _number(60.0, 0.1, 3600.0, "s", "of a pose before its frame; more is another clock")
    max_speed_mps: float = _number(
        60.0, 0.1, 1000.0, "m/s", "of the sensor; poses farther apart: a sender begun anew"
    )
    capacity: int = _number(256, 2, 65536, "", "poses kept, and taken in one frame at most")


@dataclass(frozen=True, slots=True, kw_only=True)
class ProfileConfig:
    """All of it: a sensor and a board, as a profile file describes them."""

    sensor: SensorConfig = field(default_factory=SensorConfig)
    segmentation: SegmentationConfig = field(default_factory=SegmentationConfig)
    tracking: TrackingConfig = field(default_factory=TrackingConfig)
    classification: ClassificationConfig = field(default_factory=ClassificationConfig)
    scheduler: SchedulerConfig = field(default_factory=SchedulerConfig)
    fusion: FusionConfig = field(default_factory=FusionConfig)
    odometry: OdometryConfig = field(default_factory=OdometryConfig)
    energy: EnergyConfig = field(default_factory=EnergyConfig)

    def __post_init__(self) -> None:
        if self.scheduler.energy_mJ_per_frame is not None and self.energy.active_W <= 0:
            raise ValueRangeError(
                "scheduler.energy_mJ_per_frame",
                "buys any number of calls, since energy.busy_W is not above energy.idle_W",
                "calibrate the board (modt-profile calibrate) or state both powers",
            )

    @property
    def classification_ms(self) -> float | None:
        """CPU time that a frame may spend on classification [ms]: what its time and its energy allow."""
        stage = self.scheduler
        by_energy = stage.energy_mJ_per_frame
        limits = [stage.cpu_ms_per_frame, None if by_energy is None else by_energy / self.energy.active_W]
        return min((limit for limit in limits if limit is not None), default=None)
