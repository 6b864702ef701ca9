"""Tracks of the detections of whole sequences, as KITTI's tracking results."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from modt.classes import CLASSES
from modt.errors import MisuseError
from modt.geometry import inverse, transform_boxes
from modt.sources import kitti_calibration, oxts
from modt.sources.pose_source import read_poses
from modt.types import Float64
from modt_desk.box_tracking.box_tracker import BOX_CLASSES, BoxTracker
from modt_desk.box_tracking.detections import DETECTED, T_LEVEL_CAMERA, Detections, box_lines, boxes_to_kitti
from modt_desk.box_tracking.whole_tracks import TrackedBoxes, bridged, confident, of_one_class


def follow(
    detections: Detections,
    poses: Float64 | None,
    period_s: float,
    least_confidence: float | None = None,
    *,
    online: bool = False,
) -> tuple[str, int]:
    """KITTI tracking results of a sequence, and the number of its tracks.

    Tracks are judged whole: by their mean confidence, and by whether a more confident one of another class follows
    the same object. Their short gaps are filled. Online, each frame is written as the tracker reports it. The
    (n, 4, 4) poses are T_world_camera, None without ego-motion. Where no minimum confidence is given, it is that of
    the type.
    """
    T = None if poses is None else T_LEVEL_CAMERA @ poses @ inverse(T_LEVEL_CAMERA)
    classes = []
    for number, object_class in enumerate(DETECTED):
        config = BOX_CLASSES[object_class]
        least = config.keep_above if least_confidence is None else least_confidence
        tracker = BoxTracker(replace(config, report_above=least if online else min(least, config.report_above)))
        found = _reports(tracker, detections.take(detections.object_class == object_class), T, period_s)
        found = replace(found, id=found.id * len(DETECTED) + number)
        classes.append(found if online else bridged(confident(found, least), config.max_gap))
    found = TrackedBoxes.join(classes)
    if not online:
        found = of_one_class(found, found.id % len(DETECTED))
    found = found.take(np.argsort(found.frame, kind="stable"))
    box = found.box
    if T is not None:
        ends = np.searchsorted(found.frame, np.arange(len(T) + 1))
        box = np.concatenate([transform_boxes(inverse(T[i]), box[ends[i] : ends[i + 1]]) for i in range(len(T))])
    names = [CLASSES[DETECTED[k]].kitti[0] for k in found.id % len(DETECTED)]
    lines = box_lines(found.frame, names, found.id, found.image_box, boxes_to_kitti(box), found.confidence)
    return "".join(lines), len(np.unique(found.id))


def _reports(
    tracker: BoxTracker, detections: Detections, T_world_level: Float64 | None, period_s: float
) -> TrackedBoxes:
    """Reports of all frames, in the world frame."""
    reports = [TrackedBoxes.none()]
    for frame, rows in detections.frames():
        seen = detections.box[rows]
        boxes = seen if T_world_level is None else transform_boxes(T_world_level[frame], seen)
        found = tracker.step(frame * period_s, boxes, detections.score[rows], np.hypot(seen[:, 0], seen[:, 1]))
        if len(found.id):
            image_box = detections.image_box[rows][found.source]
            frames = np.full(len(found.id), frame)
            reports.append(TrackedBoxes(frames, found.id, image_box, found.box, found.confidence))
    return TrackedBoxes.join(reports)


def camera_poses(
    poses: Path | None, oxts_folder: Path | None, sequence: Detections, sequences: int
) -> Float64 | None:
    """(n, 4, 4) T_world_camera of every frame of the sequence, from files of poses or of OXTS records.

    Raises:
        MisuseError: there is no file for the sequence, or it is too short.
    """
    given = poses or oxts_folder
    if given is None:
        return None
    if not given.is_dir() and sequences > 1:
        raise MisuseError(given, f"one file for {sequences} sequences", "give a folder with a file for each")
    path = given / f"{sequence.name}.txt" if given.is_dir() else given
    if not path.is_file():
        raise MisuseError(path, "is missing", "add it, or run without ego-motion")
    if poses is not None:
        found = read_poses(path)
    else:
        calib = path.parent.parent / "calib" / path.name
        T_imu_sensor = kitti_calibration.T_imu_sensor_of_sequence(calib)
        T_sensor_camera = inverse(kitti_calibration.camera_of_sequence(calib).T_camera_sensor)
        found = oxts.poses(oxts.read_records(path)) @ T_imu_sensor @ T_sensor_camera
    if len(found) < sequence.n_frames:
        raise MisuseError(path, f"{len(found)} poses for {sequence.n_frames} frames", "give one a frame")
    return found
