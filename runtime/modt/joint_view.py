"""The view of several sensors of a robot, each segmented by itself and joined before the tracking.

The stages work in the *common frame*: level, with the heading of the robot, and with its origin in the middle of the
sensors. Lines of sight from there are close to those of each sensor. The results are in the frame of the robot, which
lies below it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from modt.classification.box_classifier import solid_angles
from modt.config import MountedSensor, SensorConfig
from modt.errors import MisuseError
from modt.geometry import inverse, se3, transform, transform_boxes, wrap
from modt.pipeline import SegmentationStage
from modt.placement import Placement, PlanarMotion, delays, joined_points, moved_points
from modt.segmentation.joining import SensorProposals, join, square_range_m2
from modt.segmentation.kernels import Kernels
from modt.segmentation.tuning import JoiningTuning
from modt.sensor_fit.levelling import Leveller
from modt.types import Float32, Float64, Frame, FrameResult, Proposals


@dataclass(frozen=True)
class SensorPart:
    """One sensor of a robot: its mount and range, and what levels and segments its sweeps."""

    mounted: MountedSensor
    sensor: SensorConfig
    leveller: Leveller
    segmenter: SegmentationStage


class JointView:
    """Joint view of several sensors.

    The sweeps of a frame differ in their stamps, and a sweep takes time itself. So the proposals of each are moved to
    the stamp of the frame, by the motion of the robot in the frame before.

    Args:
        parts: the sensors, in the order of the sweeps of a frame.
        kernels: passes over points.
        tuning: which proposals are one.
    """

    def __init__(self, parts: Sequence[SensorPart], kernels: Kernels, tuning: JoiningTuning) -> None:
        self._parts = parts
        self._kernels = kernels
        self._tuning = tuning
        self._motion = PlanarMotion()
        middle = np.mean([part.mounted.position_m for part in parts], axis=0)
        self.T_robot_common = se3(np.eye(3), middle)
        T_common_robot = inverse(self.T_robot_common)
        self._T_robot_sensor = [part.mounted.T_robot_sensor for part in parts]
        self._T_common_level = [T_common_robot @ part.mounted.T_robot_level for part in parts]

    def facts(self) -> dict[str, str]:
        """Kernels of the segmenters."""
        return self._parts[0].segmenter.facts()

    def level(self, frame: Frame) -> Frame:
        """The frame in the common frame, with each of its sweeps turned level.

        Raises:
            MisuseError: the frame is of one sensor.
        """
        if len(frame.sweeps) != len(self._parts):
            names = ", ".join(part.mounted.name for part in self._parts)
            raise MisuseError("frame", f"holds no sweeps of {names}", "open its recording by this profile")
        sweeps = [self._level_sweep(k, frame) for k in range(len(self._parts))]
        # A level pose of any sensor gives the pose of the common frame.
        T_world_common = None
        for T_common_level, sweep in zip(self._T_common_level, sweeps, strict=True):
            if sweep is not None and sweep.T_world_sensor is not None:
                T_world_common = sweep.T_world_sensor @ inverse(T_common_level)
                break
        points = joined_points(sweeps, self._T_common_level)
        return replace(frame, points=points, T_world_sensor=T_world_common, sweeps=tuple(sweeps))

    def _level_sweep(self, k: int, frame: Frame) -> Frame | None:
        """Sweep of a sensor turned level, with its pose at the stamp of the frame."""
        sweep = frame.sweeps[k]
        if sweep is None:
            return None
        T_world_robot = frame.T_world_sensor
        T_world_sensor = None if T_world_robot is None else T_world_robot @ self._T_robot_sensor[k]
        return self._parts[k].leveller.level(replace(sweep, T_world_sensor=T_world_sensor))

    def segment(self, frame: Frame) -> Proposals:
        """Proposals of all sensors as if seen at the stamp; an object that several of them see has one."""
        return join([*self._views(frame)], self._kernels, self._tuning)

    def _views(self, frame: Frame) -> Iterator[SensorProposals]:
        """Each sensor that has a sweep, in the common frame."""
        for part, T_common_level, sweep in zip(self._parts, self._T_common_level, frame.sweeps, strict=True):
            if sweep is None:
                continue
            seen = part.segmenter.segment(sweep.points)
            delay_s = delays(seen.centroid, seen.box, sweep.turn_s, sweep.mid_rad)
            proposals = _moved(seen, T_common_level)
            if part.sensor.reflectance != self._parts[0].sensor.reflectance:  # of another scale than the model's
                proposals = replace(proposals, reflectance=None)
            step = self._motion.displacement(proposals.centroid[:, :2], delay_s + (sweep.stamp_s - frame.stamp_s))
            proposals = _shifted(proposals, step)
            # A point covers the same area, whether it is seen from the sensor or from the common origin.
            nearer = square_range_m2(seen.box) / square_range_m2(proposals.box)
            yield SensorProposals(proposals, solid_angles(seen.box, part.sensor) * nearer, len(sweep.points))

    def leave_out(self, dead_deg: tuple[float, ...]) -> None:
        """Nothing: dead beams are left out by the segmentation of a single sensor."""

    def finish(self, result: FrameResult, placement: Placement) -> FrameResult:
        """The result in the frame of the robot. The motion of the robot is kept for the next frame."""
        self._motion = placement.motion
        T = self.T_robot_common
        frame = replace(result.frame, points=self._points(result.frame, placement.motion))
        if (T_world_common := frame.T_world_sensor) is not None:
            frame = replace(frame, T_world_sensor=T_world_common @ inverse(T))
        return replace(
            result,
            frame=frame,
            T_world_sensor=result.T_world_sensor @ inverse(T),
            proposals=_moved(result.proposals, T).lock(),
        )

    def _points(self, frame: Frame, motion: PlanarMotion) -> Float32:
        """(N, 4) points of a frame in the frame of the robot, each sweep moved from its stamp to the frame's."""
        begin = 0
        moved = [np.zeros((0, 4), np.float32)]
        for sweep in frame.sweeps:
            if sweep is None:
                continue
            end = begin + len(sweep.points)
            T = self.T_robot_common @ motion.T_stamp_seen(sweep.stamp_s - frame.stamp_s)
            moved.append(moved_points(T, frame.points[begin:end]))
            begin = end
        return np.concatenate(moved)


def _moved(proposals: Proposals, T: Float64) -> Proposals:
    """The proposals moved by a (4, 4) transform that turns about the vertical alone."""
    R = T[:3, :3].astype(np.float32)
    ground_z_m = proposals.ground_z_m
    box = transform_boxes(T, proposals.box)
    box[:, 6] = wrap(box[:, 6])
    return replace(
        proposals,
        coordinates=R @ proposals.coordinates + T[:3, 3:].astype(np.float32),
        centroid=transform(T, proposals.centroid),
        box=box,
        ground_z_m=None if ground_z_m is None else ground_z_m + T[2, 3],
    )


def _shifted(proposals: Proposals, step: Float64) -> Proposals:
    """The proposals, each displaced by its step (P, 2) [m]."""
    if not step.any():
        return proposals
    centroid = proposals.centroid.copy()
    centroid[:, :2] += step
    box = proposals.box.copy()
    box[:, :2] += step
    coordinates = proposals.coordinates.copy()
    coordinates[:2] += step.T.astype(np.float32).repeat(proposals.count, axis=1)
    return replace(proposals, centroid=centroid, box=box, coordinates=coordinates)
