"""The library: recordings and a pipeline for programs that have their own loop."""

from __future__ import annotations

import difflib
import logging
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from importlib import import_module
from operator import index
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from modt import profile
from modt.app import assembly
from modt.app.chosen_profile import AwaitedSweep, choose
from modt.class_sizes import unknown_near
from modt.classes import CLASS_NAMES, ObjectClass
from modt.classification.own_classifier import Classifier, OwnClassifier
from modt.classification.pointnet import PointNet
from modt.config import ProfileConfig
from modt.errors import MisuseError
from modt.geometry import FieldOfView, inverse, transform_boxes
from modt.pipeline import ClassificationStage
from modt.profile import load as load_profile
from modt.sources.pose_file import pose_defect
from modt.sources.recognise import open_stream
from modt.sources.scan_file import sanitised
from modt.sources.stream import Stream, no_seconds, unit_of
from modt.types import (
    MOTION_NAMES,
    UNRECORDED,
    Bool,
    Float32,
    Float64,
    Frame,
    FrameResult,
    Int,
    MotionState,
    PointKind,
    Self,
)

__all__ = ["MOTION_NAMES", "Pipeline", "PointKind", "TrackedObjects", "open"]
log = logging.getLogger(__name__)


def open(path: str | PathLike[str], *, profile: profile.Names = None, **capture: str) -> Stream:
    """Open a recording: a KITTI drive, a scene of nuScenes, a log of Argoverse 2, scans, packets, or one of ROS 2.

    A frame has an index, a stamp_s [s], points (N, 4), and the recording's pose T_world_sensor, else None. The stream
    can be iterated repeatedly. `between(first, last)` selects a part of it, `info` describes it, and `faults` lists
    unusable scans. `capture` adds facts that a recording does not hold, as `--capture` of `modt replay`: model,
    calibration or metadata of a sensor, the topic of a recording. A `profile`, by name or file, gives the time
    between scans without time stamps. With one of several sensors the frames are those of the robot, which hold the
    sweeps of all sensors.

    Raises:
        MisuseError: there is no stream at the path, or an option does not apply, or the profile cannot be used.
        ModtError: the recording cannot be read.
    """
    config = load_profile(profile)
    if config.sensors:
        from modt.app.recorded_sensors import open_recordings

        return open_recordings(config.sensors, Path(path), config.sensor.period_s, capture)
    return open_stream(Path(path), config.sensor.period_s, capture)


@dataclass(frozen=True)
class TrackedObjects:
    """The tracks alive after a frame, n rows.

    Attributes:
        id: (n,) number of the track, never used twice.
        object_class: (n,) index in modt.CLASS_NAMES.
        posterior: (n, 4) probability of each class.
        final: (n,) whether the class is confirmed.
        visible: (n,) whether the track matches a proposal of this frame.
        unknown_near: (n,) whether the track is reported as background, but too near to rule out a person.
        moving: (n,) whether the track moves; it may be unknown (`motion`).
        motion: (n,) index in modt.MOTION_NAMES: unknown, still, moving.
        moving_probability: (n,)
        box: (n, 7) of the whole object, as estimated: x, y, z of the centre, length, width, height [m], yaw [rad] in
            the sensor frame, for a tilted sensor the level frame at its place.
        heading_known: (n,) whether the yaw of `box` is that of its front; else it may be turned round.
        seen: (n, 7) box of what this sweep shows of it, in the same frame; NaN if not visible.
        box_world: (n, 7) `box` in the world.
        position: (n, 2) filtered x, y [m, world].
        position_covariance: (n, 2, 2) [m2].
        velocity: (n, 2) [m/s, world], 0 of what is still.
        velocity_covariance: (n, 2, 2) [m2/s2].
        heading_rad, speed_mps: (n,) heading and speed of the motion in the world.
        points: (n,) number of points of the last proposal.
        age, missed: (n,) frames since birth, and since the last proposal.
        T_world_sensor: (4, 4) pose of the sensor frame at the stamp, as given or as registered.
        result: the frame as the stages exchange it, with its points.
    """

    id: Int
    object_class: Int
    posterior: Float64
    final: Bool
    visible: Bool
    unknown_near: Bool
    moving: Bool
    motion: Int
    moving_probability: Float64
    box: Float64
    heading_known: Bool
    seen: Float64
    box_world: Float64
    position: Float64
    position_covariance: Float64
    velocity: Float64
    velocity_covariance: Float64
    heading_rad: Float64
    speed_mps: Float64
    points: Int
    age: Int
    missed: Int
    T_world_sensor: Float64
    result: FrameResult

    @property
    def labels(self) -> Int:
        """(N,) track of each point of the sweep, else its negative modt.PointKind. Each call computes them."""
        return self.result.labels

    def obstacles(self) -> Int:
        """(K,) rows of the points of the sweep that stand above the ground and below the ceiling."""
        return self.result.obstacles()

    def __len__(self) -> int:
        return len(self.id)

    def __getitem__(self, row: int) -> dict[str, Any]:
        """One row, as in as_dicts. Iteration yields the rows too."""
        return self.take(np.array([range(len(self))[index(row)]])).as_dicts()[0]

    def __repr__(self) -> str:
        counts = np.bincount(self.object_class, minlength=len(CLASS_NAMES)).tolist()
        named = ", ".join(f"{n} {name}" for n, name in zip(counts, CLASS_NAMES, strict=True) if n)
        return f"<{len(self)} tracked objects: {named or 'none'}; {np.count_nonzero(self.visible)} visible>"

    def _repr_html_(self) -> str:
        """Table of the rows, for notebooks."""
        names = ("id", "object_class", "final", "points", "age", "speed_mps")
        rows = [[f"{row[n]:.1f}" if n == "speed_mps" else str(row[n]) for n in names] for row in self.as_dicts()]
        cells = "".join(f"<tr><td>{'</td><td>'.join(row)}</td></tr>" for row in rows)
        return f"<table><tr><th>{'</th><th>'.join(names)}</th></tr>{cells}</table>"

    def take(self, rows: Int | Bool) -> Self:
        """Rows selected by index or mask."""
        return replace(self, **{name: column[rows] for name, column in self._columns().items()})

    def objects(self) -> Self:
        """Visible rows that are of a class or move."""
        return self.take(((self.object_class != ObjectClass.BACKGROUND) | self.moving) & self.visible)

    def as_dicts(self) -> list[dict[str, Any]]:
        """One dictionary a row, of plain numbers and lists. Its object_class and motion are names."""
        columns = {name: column.tolist() for name, column in self._columns().items()}
        columns["object_class"] = [CLASS_NAMES[c] for c in self.object_class.tolist()]
        columns["motion"] = [MOTION_NAMES[m] for m in self.motion.tolist()]
        return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]

    def to_pandas(self) -> Any:
        """pandas.DataFrame with the columns of as_dicts. Raises MisuseError if pandas is not installed."""
        try:
            pandas = import_module("pandas")
        except ModuleNotFoundError as error:
            raise MisuseError("to_pandas", f"needs {error.name}", "pip install pandas") from None
        return pandas.DataFrame(self.as_dicts(), columns=[*self._columns()])

    def _columns(self) -> dict[str, Any]:
        """Fields that have a row a track."""
        of_frame = ("T_world_sensor", "result")
        return {f.name: getattr(self, f.name) for f in fields(self) if f.name not in of_frame}


class Pipeline:
    """Segmentation, tracking, scheduled classification and fusion of one sensor's sweeps.

        import modt
        pipeline = modt.Pipeline.from_profile("vlp-16", mode="accurate")
        for frame in modt.open("DRIVE"):
            for found in pipeline.step(frame).objects().as_dicts():
                print(found["id"], found["object_class"], found["box"])

    The mode is "conventional", "efficient" or "accurate". `classifier` takes the place of the network
    (modt.classification.own_classifier.Classifier).

    Raises:
        MisuseError: the mode is unknown, a model cannot be used, or the classifier returns no likelihoods.
    """

    def __init__(self, config: ProfileConfig, mode: str = "accurate", classifier: Classifier | None = None) -> None:
        if mode not in assembly.MODES:
            raise MisuseError(f"mode {mode!r}", "unknown", f"use one of {', '.join(assembly.MODES)}")
        self.mode = mode
        self._classifier = classifier
        self._asked: profile.Resolved | ProfileConfig = config
        self._use(config)
        self._index = 0
        self._awaited = AwaitedSweep()
        self._stamp_s = -math.inf  # of the last sweep
        self._warned = False  # of stamps that are no seconds

    def __repr__(self) -> str:
        return f"<pipeline in mode {self.mode} after {self._index} frames>"

    def _use(self, config: ProfileConfig) -> None:
        chosen = assembly.MODES[self.mode]
        self.config = config
        self._pipeline = assembly.pipeline(chosen, config, FieldOfView(), substitute=self._substitute)
        self._budget = chosen.budget(config)

    def _substitute(self, network: PointNet) -> ClassificationStage:
        """The given classifier, or the network without one."""
        return network if self._classifier is None else OwnClassifier(self._classifier, network.class_frequency)

    @classmethod
    def from_profile(
        cls, names: profile.Names = None, mode: str = "accurate", classifier: Classifier | None = None
    ) -> Self:
        """Make a pipeline from profiles by name or file. Later ones win key by key.

        If no profile names the sensor, it is that of the default, or the one that the first sweep shows.

        Raises:
            MisuseError: the profile or mode does not exist, or a profile has an error, whose line is named.
        """
        asked = profile.resolve(names)
        pipeline = cls(asked.config, mode, classifier)
        pipeline._asked = asked
        return pipeline

    def _joined(self, points: Mapping[str, ArrayLike], stamp_s: float, turn_s: float, mid_rad: float) -> Frame:
        """The frame of the sweeps of several sensors, by their names, at one time."""
        from modt.sources.joining import joint_frame

        sensors = self.config.sensors
        names = [sensor.name for sensor in sensors]
        if not sensors or not points:
            there = ", ".join(names) or "an array, as the profile has one sensor"
            raise MisuseError("points", "are of no sensor of the profile", f"give {there}")
        for name in points:
            if name not in names:
                near = difflib.get_close_matches(name, names, n=1, cutoff=0.0)
                raise MisuseError(f"sensor '{name}'", "is not in the profile", f"did you mean '{near[0]}'?")
        sweeps = {
            names.index(name): Frame(self._index, stamp_s, _checked_points(of_sensor), turn_s=turn_s, mid_rad=mid_rad)
            for name, of_sensor in points.items()
        }
        return joint_frame(self._index, sweeps, sensors)

    def _checked(self, frame: Frame, T_world_sensor: ArrayLike | None) -> Frame:
        """The next frame of this pipeline, with its own pose or a given one."""
        return replace(
            frame,
            index=self._index,
            stamp_s=self._checked_stamp(frame.stamp_s),
            points=_checked_points(frame.points),
            T_world_sensor=_checked_pose(frame.T_world_sensor if T_world_sensor is None else T_world_sensor),
            restarts=0,
            steady_s=None,
            R_level_sensor=None,
            frame_id="",
        )

    def _checked_stamp(self, stamp_s: float | None) -> float:
        """Time of a sweep [s]."""
        if stamp_s is None:
            raise MisuseError("stamp None", "the points have no time", "give the time of the sweep [s]")
        if wrong := no_seconds(stamp_s):
            raise MisuseError("step", wrong, "give rising times [s]")
        if stamp_s < self._stamp_s:
            last = f"not after the last one, {self._stamp_s!r}"
            raise MisuseError(f"stamp {stamp_s!r}", last, "give rising times [s]")
        return float(stamp_s)

    def _warn_of_unit(self, stamp_s: float) -> None:
        """Warn once if the time since the last sweep is a period in another unit than seconds."""
        passed_s = stamp_s - self._stamp_s
        unit = unit_of(passed_s / self.config.sensor.period_s)
        if unit and not self._warned:
            self._warned = True
            log.warning("stamps: %g s lie between two sweeps: are they in %s? Give seconds", passed_s, unit)

    def step(
        self,
        points: ArrayLike | Frame | Mapping[str, ArrayLike],
        stamp_s: float | None = None,
        T_world_sensor: ArrayLike | None = None,
        *,
        turn_s: float = 0.0,
        mid_rad: float = 0.0,
    ) -> TrackedObjects:
        """Process one sweep and return the tracks after it.

        Args:
            points: a frame of `open`, which needs no other argument; or (N, 3) or (N, 4) x, y, z [m, sensor frame:
                x forward, y left, z up], reflectance [0, 1]. Points that are not finite count as no return. A robot
                with several sensors has such points by the name of the sensor, each in its own frame.
            stamp_s: time of the sweep [s], never before that of the last one.
            T_world_sensor: (4, 4) pose at the stamp; of the robot if it has several sensors. None estimates the
                motion of the sensor from the proposals.
            turn_s: as modt.types.Frame.turn_s, for sweeps that are not compensated for the motion of the sensor.
            mid_rad: as modt.types.Frame.mid_rad.

        Raises:
            MisuseError: an argument has another shape, a stamp goes back, or a matrix is no pose.
            ScanError: the columns are not x, y, z, reflectance.
        """
        if isinstance(points, Mapping):
            points = self._joined(points, self._checked_stamp(stamp_s), turn_s, mid_rad)
        if not isinstance(points, Frame):
            rows: Any = points  # checked below
            points = Frame(self._index, self._checked_stamp(stamp_s), rows, turn_s=turn_s, mid_rad=mid_rad)
        frame = self._checked(points, T_world_sensor)
        if self._awaited.comes_with(frame):
            chosen = choose(self._asked, frame, None)
            if chosen.config != self.config:
                self._use(chosen.config)
            self._awaited.take(frame)
        self._warn_of_unit(frame.stamp_s)
        self._index += 1
        self._stamp_s = frame.stamp_s
        result = self._pipeline.step(frame, self._budget)
        tracks = result.tracks
        visible = tracks.observed
        seen = np.full((len(tracks), 7), np.nan)
        seen[visible] = result.proposals.box[tracks.proposal[visible]]
        return TrackedObjects(
            id=tracks.id,
            object_class=tracks.object_class,
            posterior=tracks.posterior,
            final=tracks.final,
            visible=visible,
            unknown_near=unknown_near(result),
            moving=tracks.motion == MotionState.MOVING.value,
            motion=tracks.motion,
            moving_probability=tracks.moving_probability,
            box=transform_boxes(inverse(result.T_world_sensor), tracks.whole_box),
            heading_known=tracks.heading_known,
            seen=seen,
            box_world=tracks.whole_box,
            position=tracks.x[:, :2],
            position_covariance=tracks.P[:, :2, :2],
            velocity=tracks.velocity,
            velocity_covariance=tracks.velocity_covariance,
            heading_rad=tracks.x[:, 2],
            speed_mps=tracks.x[:, 3],
            points=tracks.points,
            age=tracks.age,
            missed=tracks.missed,
            T_world_sensor=result.T_world_sensor,
            result=result,
        )


def _checked_points(points: ArrayLike) -> Float32:
    """(N, 4) contiguous finite points. A missing fourth column is filled with unrecorded reflectance."""
    rows = np.array(points, np.float32, order="C")  # row by row, as the kernels read them
    if rows.ndim != 2 or rows.shape[1] not in (3, 4):
        raise MisuseError("points", f"of shape {rows.shape}", "give rows of x, y, z or x, y, z, reflectance")
    if rows.shape[1] == 3:
        rows = np.column_stack([rows, np.full(len(rows), UNRECORDED, np.float32)])
    return sanitised(rows, "points")[0]


def _checked_pose(T_world_sensor: ArrayLike | None) -> Float64 | None:
    """(4, 4) pose of the sensor in the world."""
    if T_world_sensor is None:
        return None
    pose = np.array(T_world_sensor, np.float64)
    defect = pose_defect(pose) if pose.shape == (4, 4) else f"of shape {pose.shape}"
    if defect:
        raise MisuseError("T_world_sensor", defect, "give a rigid (4, 4) transform from sensor to world")
    return pose
