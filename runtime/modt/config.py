"""Configuration: one frozen dataclass a stage, every value bounded and checked as it is made.

Defaults of the segmentation without another source were chosen on labelled KITTI scans (docs/evaluation.md).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import Field, dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any

from modt.classes import CLASS_NAMES, CLASSES, N_SHIPPED, OBJECTS, PERSON_HEIGHT_M
from modt.errors import MisuseError

if TYPE_CHECKING:
    from modt.geometry.beams import Beams
    from modt.types import Float64

BATCH = 8
"""Proposals of one network call: few enough for their features to stay in the cache."""
NATIVE = "native"
NUMPY = "numpy"
KERNELS = ("auto", NATIVE, NUMPY)
"""Names of the code for points."""
GRID_CELLS = 200
"""Cells of both grids of the segmentation per metre of range, at a cell of 1 m."""
MAX_CELLS = 5e7
"""Greatest number of cells of both grids (200 MB)."""
DEFAULT_SPAN_DEG = -15.0, 15.0
"""Elevations of the lowest and the highest beam of a sensor whose profile has none."""
REFLECTANCE_SCALES = ("hdl-64e", "pandar64")
"""Sensors whose reflectance a model may have learnt."""


class ValueRangeError(MisuseError):
    """A configuration value of the wrong type or out of its range. Its subject is the key."""


def number(default: float | None, low: float, high: float, unit: str, meaning: str) -> Any:
    """Field of a number within bounds."""
    return field(default=default, metadata={"low": low, "high": high, "unit": unit, "meaning": meaning})


def numbers(low: float, high: float, most: int, unit: str, meaning: str, *, pairs: bool = False) -> Any:
    """Field of two to `most` numbers within bounds; in pairs their number is even. The default is null."""
    facts = {"low": low, "high": high, "least": 2, "most": most, "unit": unit, "meaning": meaning}
    return field(default=None, metadata={**facts, "pairs": pairs})


def choice(default: str, options: tuple[str, ...], meaning: str) -> Any:
    """Field of one name among options."""
    return field(default=default, metadata={"options": options, "meaning": meaning})


RARE = 0.001
"""Share of a class of the user's own among the proposals, where a profile states those of modt's classes alone."""


def per_class(column: str | None, low: float, high: float, meaning: str, classes: Sequence[int] = OBJECTS) -> Any:
    """Field of a number for each class; the defaults are a column of the class table, null without one.

    A profile may leave out the values of the user's own classes, the last ones.
    """
    values = tuple(getattr(CLASSES[c], column) if column else RARE for c in classes)
    meaning = f"{meaning} Values for {', '.join(CLASS_NAMES[c] for c in classes)}."
    facts = {"low": low, "high": high, "least": len(classes), "most": len(classes), "meaning": meaning}
    own = values[len(classes) - len(CLASSES) + N_SHIPPED :]
    return field(default=values if column else None, metadata={**facts, "own": own})


def completed(declared: Field[Any], value: Any) -> Any:
    """The value of a field by class, with those of the user's own classes where it has none of them."""
    own = declared.metadata.get("own", ())
    complete = isinstance(value, tuple) and len(value) == declared.metadata.get("most", 0) - len(own)
    return (*value, *own) if complete else value


@dataclass(frozen=True, slots=True, kw_only=True)
class StageConfig:
    """Base of every stage's configuration: checks each value against its declared bounds.

    Raises:
        ValueRangeError: a value is not of its kind or out of range.
    """

    def __post_init__(self) -> None:
        for f in fields(self):
            check(f, getattr(self, f.name))


def check(declared: Field[Any], value: object) -> None:
    """Check a value against the bounds that its field declares.

    Raises:
        ValueRangeError: it is not of its kind or out of range.
    """
    key = declared.name
    kind = str(declared.type)
    bounds = declared.metadata
    if not bounds or (value is None and "None" in kind):
        return
    if "options" in bounds:
        if value not in bounds["options"]:
            raise ValueRangeError(key, f"{value!r} is unknown", f"use one of {', '.join(bounds['options'])}")
    elif kind == "str":
        if not isinstance(value, str):
            raise ValueRangeError(key, f"{value!r} is no text", "write a name")
    else:
        _check_numbers(key, value, kind.startswith("int"), bounds)


def _check_numbers(key: str, value: object, whole: bool, bounds: Mapping[str, Any]) -> None:
    numbers = value if "most" in bounds and isinstance(value, tuple) else (value,)
    noun = "a whole number" if whole else "a number"
    span = f"{noun} from {bounds['low']:g} to {bounds['high']:g}"
    if "most" in bounds:
        least = bounds["least"]
        most = bounds["most"]
        span = f"{most if least == most else f'{least} to {most}'} values, each {span}"
        if not least <= len(numbers) <= most:
            raise ValueRangeError(key, f"{len(numbers)} values", f"give {span}")
        if bounds.get("pairs") and len(numbers) % 2:
            raise ValueRangeError(key, f"{len(numbers)} values are no pairs", "give from and to of each, in one list")
    remedy = f"give {span} {bounds.get('unit', '')}".rstrip()
    for number in numbers:
        if isinstance(number, bool) or not isinstance(number, int if whole else (int, float)):
            raise ValueRangeError(key, f"{value!r} is not {noun}", remedy)
        if not bounds["low"] <= number <= bounds["high"]:
            raise ValueRangeError(key, f"{number!r} is out of range", remedy)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassificationConfig(StageConfig):
    """The network and its input (section V-A)."""

    model: str = field(
        default="pointnet-kitti", metadata={"meaning": "Name of a model in models/, or path of an .onnx file."}
    )
    likelihood: str = choice(
        "pooled",
        ("pooled", "network"),
        "How likely a view is for each class. pooled: by the network together with the classifiers of box and "
        "reflectance, on the proposal's own points. network: as in the paper by the network alone, on exactly "
        "max_points points, one proposal a call.",
    )
    max_points: int = number(128, 8, 4096, "", "Greatest number of points of a proposal that the network sees.")

    @property
    def batch(self) -> int:
        """Proposals of one network call at most."""
        return BATCH if self.likelihood == "pooled" else 1

    @property
    def min_points(self) -> int:
        """Number of points to which a smaller proposal is repeated; more costs CPU time and changes no class."""
        return 1 if self.likelihood == "pooled" else self.max_points


@dataclass(frozen=True, slots=True, kw_only=True)
class SchedulerConfig(StageConfig):
    """Budget of classification. Null means no limit, and the limit that is reached first applies."""

    calls_per_frame: int | None = number(24, 0, 10000, "", "Greatest number of proposals classified in a frame.")
    cpu_ms_per_frame: float | None = number(
        None, 0.0, 10000.0, "ms", "CPU time of classification in a frame, on average over a second."
    )
    energy_mJ_per_frame: float | None = number(
        None, 0.0, 100000.0, "mJ", "Energy of classification in a frame above idling, on average over a second."
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class DecisionConfig(StageConfig):
    """The reported class of a track."""

    rule: str = choice(
        "adapted",
        ("adapted", "likeliest"),
        "How the class is chosen. adapted: posteriors are adapted to the class frequency of the stream, and a class "
        "is kept down to a posterior of 0.4. likeliest: the likeliest object, from its threshold on.",
    )
    missed_cost: tuple[float, ...] = per_class(
        "missed_cost",
        0.01,
        1000.0,
        "Cost of a missed object, relative to a false one. Objects are reported from a posterior of 1 / (1 + cost).",
    )
    frequency: tuple[float, ...] | None = per_class(
        None,
        0.0001,
        0.33,
        "Share of each class among the proposals at the start of a run. Null: as the model assumes.",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class FusionConfig(StageConfig):
    """Fusion of views, boxes and motion to a class, and its confirmation (section V-C, Figs. 10 and 11)."""

    rule: str = choice(
        "mean",
        ("mean", "product"),
        "How the views of a track are combined. mean: averaged. product: multiplied, Equation 6 of the paper.",
    )
    object_threshold: float = number(0.9, 0.25, 1.0, "", "Posterior from which the class of an object is confirmed.")
    min_object_probability: float = number(
        0.1, 0.0, 1.0, "", "Tracks less likely an object by box and motion are not classified."
    )
    start_frame: int = number(
        4, 1, 1000, "frames", "Age of a track from which its views are combined, with rule product."
    )
    point_change: tuple[float, ...] = per_class(
        "point_change",
        0.0,
        10.0,
        "Relative change of the number of points (Equation 4) from which a view is independent, with rule product.",
        range(len(CLASSES)),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryConfig(StageConfig):
    """Poses from another program, in effect with `--odometry udp://`, `unix://` and `ros2://`."""

    max_speed_mps: float = number(
        60.0, 0.1, 1000.0, "m/s", "Greatest speed of the sensor. A faster jump means a restarted sender."
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmentationConfig(StageConfig):
    """Ground, clusters, and the sizes that an object can have (section III-A)."""

    max_slope_deg: float = number(
        16.0,
        0.5,
        45.0,
        "deg",
        "Greatest change of the slope of the ground along a ray; the ground is at most twice as steep.",
    )
    clearance_m: float = number(0.25, 0.02, 1.0, "m", "Height above the ground from which points belong to objects.")
    max_height_m: float = number(2.6, 0.3, 20.0, "m", "Height above the ground up to which points belong to objects.")
    cell_m: float = number(
        0.105, 0.01, 2.0, "m", "Side of a cell at 10 m. It grows with the square root of the range."
    )
    min_points: int = number(5, 1, 1000, "", "Least number of points of a proposal.")
    max_extent_m: float = number(20.0, 0.5, 50.0, "m", "Greatest length of a proposal.")
    min_height_m: float = number(0.2, 0.0, 3.0, "m", "Least height of a proposal.")
    kernels: str = choice(
        "auto",
        KERNELS,
        "Code for points: compiled (native), NumPy (numpy), or compiled where it can be (auto). "
        "The environment variable MODT_KERNELS overrules this key.",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackingConfig(StageConfig):
    """Association of proposals with tracks, and the end of a track."""

    association: str = choice("kdop", ("kdop", "paper"), "Cost of a match: by outlines (kdop), or as in the paper.")
    extensions: str = choice(
        "all",
        ("all", "none"),
        "Additions to the paper: tracks split, merge and reunite proposals, and can be at rest. none: switched off.",
    )
    max_missed: int = number(
        8, 0, 100, "frames", "Time without a proposal, in periods, after which a track is deleted (N of a9 and a14)."
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorConfig(StageConfig):
    """Mount, range and resolution of the sensor."""

    height_m: float | None = number(
        1.73, 0.05, 5.0, "m", "Height of the sensor above the ground. Null: estimated from the first sweeps."
    )
    roll_deg: float | None = number(
        None, -180.0, 180.0, "deg", "Roll of the mount, left side up. Null: measured in the first sweep."
    )
    pitch_deg: float | None = number(
        None, -90.0, 90.0, "deg", "Pitch of the mount, nose down. Null: measured in the first sweep."
    )
    min_range_m: float = number(2.0, 0.0, 20.0, "m", "Nearer points are left out, as they may be the robot's own.")
    max_range_m: float = number(80.0, 1.0, 400.0, "m", "Farther points are left out.")
    elevation_step_deg: float = number(0.42, 0.01, 10.0, "deg", "Angle between neighbouring beams, evenly spaced.")
    elevations_deg: tuple[float, ...] | None = numbers(
        -90.0, 90.0, 512, "deg", "Elevation of every beam, in any order. Null: the beams are evenly spaced."
    )
    elevation_span_deg: tuple[float, ...] | None = numbers(
        -90.0, 90.0, 2, "deg", "Elevations of the lowest and the highest beam. Null: not known."
    )
    azimuth_step_deg: float = number(0.17, 0.01, 10.0, "deg", "Angle between neighbouring returns of a beam.")
    blind_sectors_deg: tuple[float, ...] | None = numbers(
        -360.0, 360.0, 64, "deg", "Sectors hidden by the robot, each from and to, counter-clockwise.", pairs=True
    )
    blind_range_m: float = number(3.0, 0.1, 20.0, "m", "Points in blind_sectors_deg up to this range are left out.")
    period_s: float = number(
        0.1, 0.001, 10.0, "s", "Time between two sweeps, for scans without time stamps and tracking.max_missed."
    )
    reflectance: str = choice(
        "none", ("none", *REFLECTANCE_SCALES), "Sensor whose scale the reflectance has. none: it is not used."
    )

    @property
    def span_deg(self) -> tuple[float, float] | None:
        """Elevations of the lowest and the highest beam; None if unknown."""
        beams = self.elevations_deg or self.elevation_span_deg
        return None if beams is None else (min(beams), max(beams))

    @property
    def assumed_span_deg(self) -> tuple[float, float]:
        """`span_deg`, or DEFAULT_SPAN_DEG if it is unknown."""
        return self.span_deg or DEFAULT_SPAN_DEG

    @property
    def rays_per_turn(self) -> float:
        """Number of rays in a turn."""
        if self.elevations_deg is not None:
            beams = float(len(self.elevations_deg))
        else:
            low_deg, high_deg = self.assumed_span_deg
            beams = (high_deg - low_deg) / self.elevation_step_deg + 1
        return beams * 360 / self.azimuth_step_deg

    @property
    def beam_elevations_deg(self) -> tuple[float, ...]:
        """Elevation of every beam, ascending; none if they are not known."""
        if self.elevations_deg is not None:
            return tuple(sorted(self.elevations_deg))
        if self.elevation_span_deg is None:
            return ()
        low_deg, high_deg = self.elevation_span_deg
        steps = max(round((high_deg - low_deg) / self.elevation_step_deg), 1)
        return tuple(low_deg + k * (high_deg - low_deg) / steps for k in range(steps + 1))

    @property
    def person_seen_from_m(self) -> float | None:
        """Distance from which half of a person is in view [m]; None if the mount or the beams are unknown."""
        if self.height_m is None or self.span_deg is None:
            return None
        low, high = (math.tan(math.radians(deg)) for deg in self.span_deg)
        for decimetres in range(1, 201):
            distance_m = decimetres / 10
            top_m = min(self.height_m + distance_m * high, PERSON_HEIGHT_M)
            bottom_m = max(self.height_m + distance_m * low, 0.0)
            if top_m - bottom_m >= PERSON_HEIGHT_M / 2:
                return distance_m
        return None

    @property
    def beams(self) -> Beams:
        """Spacing of the beams."""
        from modt.geometry.beams import beams_of  # NumPy, which commands import after they are pinned

        return beams_of(self.elevations_deg, self.elevation_step_deg)


@dataclass(frozen=True, slots=True, kw_only=True)
class EnergyConfig(StageConfig):
    """Power of the board where no meter is read, and the coefficients that `modt-profile calibrate` finds.

    Energy of a window = idle_W x time + seg_J x segmentations + class_J x classifications + point_J x points.
    """

    board: str = field(default="unknown", metadata={"meaning": "Name of the board in reports."})
    idle_W: float = number(3.0, 0.0, 1000.0, "W", "Power of the board while modt waits.")
    busy_W: float = number(7.0, 0.0, 1000.0, "W", "Power of the board while modt computes on one core.")
    meter: str = field(default="none", metadata={"meaning": "Name of the meter that the calibration read."})
    seg_J: float | None = number(None, -1000.0, 1000.0, "J", "Energy of one segmentation. Null: not calibrated.")
    class_J: float | None = number(
        None, -1000.0, 1000.0, "J", "Energy of one classification, without its points. Null: not calibrated."
    )
    point_J: float | None = number(
        None, -1000.0, 1000.0, "J", "Energy of one point that is classified. Null: not calibrated."
    )

    @property
    def active_W(self) -> float:
        """Power of one busy core beyond idle [W], equal to mJ/ms."""
        return self.busy_W - self.idle_W

    @property
    def coefficients(self) -> tuple[float, float, float] | None:
        """seg_J, class_J and point_J of a calibration; None unless all three are set."""
        if self.seg_J is None or self.class_J is None or self.point_J is None:
            return None
        return self.seg_J, self.class_J, self.point_J


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopConfig(StageConfig):
    """Limit of the live loop, in effect with `modt run`."""

    power_W: float | None = number(
        None,
        0.01,
        1000.0,
        "W",
        "Power of the board, with its idle power, above which the loop sheds load. Null: no limit.",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class TrustConfig(StageConfig):
    """Results while modt is blind, that is while what it reports does not follow from what is around."""

    results: str = choice(
        "always",
        ("always", "unless_blind"),
        "What sinks get. always: every result, with its trust. unless_blind: none while the trust is blind; "
        "the records go on.",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingConfig(StageConfig):
    """Records of the live loop, in effect with `modt run`."""

    keep: str = choice(
        "all", ("all", "tracks", "ledger", "none"), "Records that are written: tracks, ledger, both or none."
    )
    disk_mb: float = number(2000.0, 1.0, 1e7, "MB", "Size of all records together. The oldest are deleted.")
    gb_per_day: float = number(
        10.0, 0.01, 1e5, "GB", "Size of the tracks of a day, after the first 0.5 GB. Frames beyond it are left out."
    )


def _vector(default: tuple[float, float, float], most: float, unit: str, meaning: str) -> Any:
    """Field of three numbers within -most and most."""
    facts = {"low": -most, "high": most, "least": 3, "most": 3, "unit": unit, "meaning": meaning}
    return field(default=default, metadata=facts)


@dataclass(frozen=True, slots=True, kw_only=True)
class MountedSensor(StageConfig):
    """One of several sensors of a robot, whose frame has x forward, y left, z up, and its origin on the ground."""

    name: str = field(metadata={"meaning": "Its key in the section."})
    profile: str = field(default="", metadata={"meaning": "Name or file of its profile."})
    source: str = field(
        default="",
        metadata={"meaning": "Address of the sensor; in a recording its topic or port; or a recording of its own."},
    )
    position_m: tuple[float, ...] = _vector(
        (0.0, 0.0, 0.0), 30.0, "m", "Place of the sensor on the robot: x, y, and height above the ground."
    )
    roll_pitch_yaw_deg: tuple[float, ...] = _vector(
        (0.0, 0.0, 0.0), 360.0, "deg", "Turns of the sensor on the robot: left side up, nose down, counter-clockwise."
    )

    def __post_init__(self) -> None:
        StageConfig.__post_init__(self)
        if not self.profile:
            raise ValueRangeError("profile", "is missing", "name the profile of this sensor")
        SensorConfig(height_m=self.position_m[2])

    def mounted(self, sensor: SensorConfig) -> SensorConfig:
        """The sensor of its profile, with this mount."""
        roll_deg, pitch_deg, _ = self.roll_pitch_yaw_deg
        return replace(sensor, height_m=self.position_m[2], roll_deg=roll_deg, pitch_deg=pitch_deg)

    @property
    def T_robot_sensor(self) -> Float64:
        """(4, 4) pose of the sensor on the robot."""
        from modt.placement import mount_pose  # NumPy, as for `beams`

        return mount_pose(self.position_m, self.roll_pitch_yaw_deg)

    @property
    def T_robot_level(self) -> Float64:
        """(4, 4) pose on the robot of the level frame of the sensor."""
        from modt.placement import mount_pose

        return mount_pose(self.position_m, (0.0, 0.0, self.roll_pitch_yaw_deg[2]))


@dataclass(frozen=True, slots=True, kw_only=True)
class ProfileConfig:
    """The whole configuration: a sensor, a board and all stages, as profiles describe them.

    With `sensors`, the sections `sensor` and `segmentation` are those of the first of them.
    """

    sensor: SensorConfig = field(default_factory=SensorConfig)
    segmentation: SegmentationConfig = field(default_factory=SegmentationConfig)
    tracking: TrackingConfig = field(default_factory=TrackingConfig)
    classification: ClassificationConfig = field(default_factory=ClassificationConfig)
    scheduler: SchedulerConfig = field(default_factory=SchedulerConfig)
    fusion: FusionConfig = field(default_factory=FusionConfig)
    decision: DecisionConfig = field(default_factory=DecisionConfig)
    odometry: OdometryConfig = field(default_factory=OdometryConfig)
    energy: EnergyConfig = field(default_factory=EnergyConfig)
    loop: LoopConfig = field(default_factory=LoopConfig)
    trust: TrustConfig = field(default_factory=TrustConfig)
    recording: RecordingConfig = field(default_factory=RecordingConfig)
    sensors: tuple[MountedSensor, ...] = ()

    def __post_init__(self) -> None:
        cells = GRID_CELLS * self.sensor.max_range_m / self.segmentation.cell_m**2
        if cells > MAX_CELLS:
            cause = f"{self.segmentation.cell_m:g} m takes {cells / 1e6:.0f} million cells at this sensor.max_range_m"
            least_m = (GRID_CELLS * self.sensor.max_range_m / MAX_CELLS) ** 0.5
            raise ValueRangeError("segmentation.cell_m", cause, f"give at least {least_m:.3f} m, or a shorter range")
        if self.scheduler.energy_mJ_per_frame is not None and self.energy.active_W <= 0:
            raise ValueRangeError(
                "scheduler.energy_mJ_per_frame",
                "buys any number of calls, since energy.busy_W is not above energy.idle_W",
                "calibrate the board (modt-profile calibrate) or state both powers",
            )

    @property
    def classification_ms(self) -> float | None:
        """CPU time that a frame may spend on classification [ms], the smaller of both budgets; None without one."""
        stage = self.scheduler
        by_energy = stage.energy_mJ_per_frame
        limits = [stage.cpu_ms_per_frame, None if by_energy is None else by_energy / self.energy.active_W]
        return min((limit for limit in limits if limit is not None), default=None)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadSensor(MountedSensor):
    """One of several sensors of a robot, with its profile as it was read together with that of the robot."""

    read: ProfileConfig

    @classmethod
    def of(cls, mounted: MountedSensor, read: ProfileConfig) -> ReadSensor:
        """A mounted sensor with its profile."""
        return cls(**{f.name: getattr(mounted, f.name) for f in fields(mounted)}, read=read)
