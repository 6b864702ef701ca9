"""Tracks of the detections of whole sequences, as KITTI's tracking results.

After the last frame whole tracks are judged: by their confidence, by rival classes on one object, and short gaps.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from modt.classes import CLASSES
from modt.errors import MisuseError, install
from modt.geometry import corners, inverse, transform_boxes, wrap
from modt.sources import kitti_calibration
from modt.sources.pose_file import read_poses
from modt.types import Float64, Int
from modt_evaluation.box_tracking.box_tracker import BOX_CLASSES, BoxTracker
from modt_evaluation.box_tracking.detections import DETECTED, T_LEVEL_CAMERA, Detections, box_lines, boxes_to_kitti

TINY = 1e-9


def iou_3d(a: Float64, b: Float64) -> Float64:
    """(n,) intersection over union of the volumes of boxes a (n, 7) and b (n, 7), row by row.

    Raises:
        MisuseError: shapely is not installed.
    """
    try:
        import shapely
    except ModuleNotFoundError:
        raise MisuseError("modt track", "needs shapely", f"{install('track')}; or give --online") from None
    ground = shapely.intersection(shapely.polygons(corners(a)), shapely.polygons(corners(b)))
    top = np.minimum(a[:, 2] + a[:, 5] / 2, b[:, 2] + b[:, 5] / 2)
    foot = np.maximum(a[:, 2] - a[:, 5] / 2, b[:, 2] - b[:, 5] / 2)
    shared = shapely.area(ground) * np.maximum(top - foot, 0.0)
    union = np.prod(a[:, 3:6], axis=1) + np.prod(b[:, 3:6], axis=1) - shared
    return np.asarray(shared / np.maximum(union, TINY))


MIN_IOU = 0.25
"""Overlap of boxes of two classes from which both are of one object."""
REACH_M = 3.0
"""Distance of centres up to which the overlap is tested."""
BOX = np.dtype(
    [
        ("frame", int),  # index of the frame
        ("id", int),  # identity of the track
        ("image_box", float, 4),  # left, top, right, bottom [pixel]
        ("box", float, 7),  # world frame
        ("confidence", float),  # confidence in the track, at that frame
    ]
)
TrackedBoxes = NDArray[np.void]
"""(n,) boxes of tracks, rows of BOX."""


def confident(found: TrackedBoxes, least: float) -> TrackedBoxes:
    """Keep the tracks whose mean confidence reaches `least`."""
    return found[_mean(found["id"], found["confidence"]) >= least]


def of_one_class(found: TrackedBoxes, object_class: Int) -> TrackedBoxes:
    """Remove tracks whose boxes mostly lie on a more confident track of another class; classes are (n,)."""
    mean = _mean(found["id"], found["confidence"])
    box = found["box"]
    # Frames are set so far apart that only boxes of one frame are neighbours.
    place = np.column_stack([box[:, :2], 2 * REACH_M * found["frame"]])
    a, b = cKDTree(place).query_pairs(REACH_M, output_type="ndarray").T
    rivals = (object_class[a] != object_class[b]) & (iou_3d(box[a], box[b]) > MIN_IOU)
    beaten = np.zeros(len(mean))
    beaten[np.where(mean[a] < mean[b], a, b)[rivals]] = 1.0
    return found[_mean(found["id"], beaten) <= 0.5]


def _mean(ids: Int, values: Float64) -> Float64:
    """(n,) mean of the values (n,) of each one's track."""
    _, track = np.unique(ids, return_inverse=True)
    return np.asarray((np.bincount(track, values) / np.bincount(track))[track])


def bridged(found: TrackedBoxes, max_gap: int) -> TrackedBoxes:
    """The boxes, ordered by frame, with those interpolated where a track is missing for max_gap frames at most."""
    found = np.sort(found, order=["id", "frame"])
    gap = np.diff(found["frame"]) - 1
    before = np.flatnonzero((np.diff(found["id"]) == 0) & (gap > 0) & (gap <= max_gap))
    missing = gap[before]
    # Each missing frame is one row: its place in the gap, and the row before the gap.
    step = 1 + np.arange(missing.sum()) - np.repeat(np.cumsum(missing) - missing, missing)
    row = np.repeat(before, missing)
    share = (step / (1 + gap[row]))[:, None]
    filled = found[row]
    after = found[row + 1]
    filled["frame"] += step
    change = after["box"] - filled["box"]
    change[:, 6] = wrap(change[:, 6])
    filled["box"] += share * change
    filled["image_box"] += share * (after["image_box"] - filled["image_box"])
    filled["confidence"] += share[:, 0] * (after["confidence"] - filled["confidence"])
    return np.sort(np.concatenate([found, filled]), order=["frame", "id"])


def track_sequence(
    detections: Detections,
    poses: Float64 | None,
    period_s: float,
    least_confidence: float | None = None,
    *,
    online: bool,
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
        found["id"] = found["id"] * len(DETECTED) + number
        classes.append(found if online else bridged(confident(found, least), config.max_gap))
    found = np.concatenate(classes)
    if not online:
        found = of_one_class(found, found["id"] % len(DETECTED))
    found = found[np.argsort(found["frame"], kind="stable")]
    box = found["box"]
    if T is not None:
        ends = np.searchsorted(found["frame"], np.arange(len(T) + 1))
        box = np.concatenate([transform_boxes(inverse(T[i]), box[ends[i] : ends[i + 1]]) for i in range(len(T))])
    names = [CLASSES[DETECTED[k]].kitti[0] for k in found["id"] % len(DETECTED)]
    boxes = boxes_to_kitti(box)
    lines = box_lines(found["frame"], names, found["id"], found["image_box"], boxes, found["confidence"])
    return "".join(lines), len(np.unique(found["id"]))


def _reports(
    tracker: BoxTracker, detections: Detections, T_world_level: Float64 | None, period_s: float
) -> TrackedBoxes:
    """Reports of all frames, in the world frame."""
    reports = [np.zeros(0, BOX)]
    for frame, rows in detections.frames():
        seen = detections.box[rows]
        boxes = seen if T_world_level is None else transform_boxes(T_world_level[frame], seen)
        tracks = tracker.step(frame * period_s, boxes, detections.score[rows], np.hypot(seen[:, 0], seen[:, 1]))
        found = np.zeros(len(tracks.id), BOX)
        found["frame"] = frame
        found["id"] = tracks.id
        found["image_box"] = detections.image_box[rows][tracks.source]
        found["box"] = tracks.box
        found["confidence"] = tracks.confidence
        reports.append(found)
    return np.concatenate(reports)


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
        found = kitti_calibration.oxts_poses(kitti_calibration.read_oxts(path)) @ T_imu_sensor @ T_sensor_camera
    if len(found) < sequence.n_frames:
        raise MisuseError(path, f"{len(found)} poses for {sequence.n_frames} frames", "give one a frame")
    return found
