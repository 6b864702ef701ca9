"""`modt track`: track the boxes of another detector."""

from __future__ import annotations

import argparse
import logging
from pathlib import Path
from typing import TYPE_CHECKING

from modt.cli import options
from modt.errors import MisuseError

if TYPE_CHECKING:
    from modt.types import Float64
    from modt_desk.box_tracking.box_tracker import BoxTracker
    from modt_desk.box_tracking.detections import Detections
    from modt_desk.box_tracking.whole_tracks import TrackedBoxes


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("track", help="track the boxes of another detector")
    p.add_argument("detections", type=Path, nargs="+", metavar="DETECTIONS", help="file of a sequence, or a folder")
    p.add_argument("--out", type=Path, required=True, metavar="DIR", help="directory of the KITTI tracking results")
    motion = p.add_mutually_exclusive_group()
    file = "camera poses in KITTI odometry's format, or a folder"
    motion.add_argument("--poses", type=Path, metavar="FILE", help=file)
    motion.add_argument("--oxts", type=Path, metavar="DIR", help="OXTS records, KITTI tracking; calib/ beside it")
    seconds, confidence = options.real(0.001, 10, "seconds"), options.real(-1000, 1000, "a confidence")
    least = "minimum of the mean of a track, online of a track in a frame (default: by type, for PointRCNN)"
    p.add_argument("--period", type=seconds, default=0.1, metavar="S", help="of the frames (default: %(default)g)")
    p.add_argument("--sure", type=confidence, metavar="CONFIDENCE", help=least)
    p.add_argument("--online", action="store_true", help="no look ahead: each frame as the tracker reports it")
    p.add_argument("--quiet", action="store_true", help="no summary")
    options.add_examples(
        p,
        "modt track 0005.txt --out tracks                 boxes of one sequence",
        "modt track detections --oxts oxts --out tracks   a folder of sequences, with the motion of the car",
    )
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Track each sequence and write its results.

    Raises:
        MisuseError: detections or poses cannot be used.
        ModtError: the results cannot be written.
    """
    import time

    from modt.sinks.output import LineFile, writing
    from modt_desk.box_tracking.detections import files, merge, read

    sequences = merge([read(files(path)) for path in arguments.detections])
    motions = [_poses(arguments, sequence, len(sequences)) for sequence in sequences]
    with writing(arguments.out):
        arguments.out.mkdir(parents=True, exist_ok=True)
    frames, ids, spent_s = 0, 0, 0.0
    for sequence, poses in zip(sequences, motions, strict=True):
        began = time.process_time()
        text, n = follow(sequence, poses, arguments.period, arguments.sure, online=arguments.online)
        spent_s += time.process_time() - began
        frames, ids = frames + sequence.n_frames, ids + n
        lines = LineFile[str](arguments.out / f"{sequence.name}.txt")
        lines.write(text)
        lines.close()
    if not ids and any(map(len, sequences)):
        logging.getLogger("modt").warning("no track is sure enough; lower --sure to write more")
    if not arguments.quiet:
        rate = f"{frames / spent_s:.0f} frames a second of CPU time" if spent_s else "no time"
        print(f"{len(sequences)} sequences, {frames} frames, {ids} tracks, {rate}: {arguments.out}")
    return 0


def follow(
    detections: Detections, poses: Float64 | None, period_s: float, sure: float | None = None, *, online: bool = False
) -> tuple[str, int]:
    """KITTI tracking results of a sequence, and the number of its tracks.

    Tracks are judged whole: by their mean confidence, and by whether a surer one of another class follows the same
    object; their short gaps are filled. Online, each frame is written as the tracker reports it. The (n, 4, 4) poses
    are T_world_camera, None without ego-motion; the minimum confidence is that of the type where none is given.
    """
    from dataclasses import replace

    import numpy as np

    from modt.classes import CLASSES
    from modt.geometry import inverse, transform_boxes
    from modt_desk.box_tracking.box_tracker import BOX_CLASSES, BoxTracker
    from modt_desk.box_tracking.detections import DETECTED, T_LEVEL_CAMERA, box_lines, boxes_to_kitti
    from modt_desk.box_tracking.whole_tracks import TrackedBoxes, bridged, confident, of_one_class

    T = None if poses is None else T_LEVEL_CAMERA @ poses @ inverse(T_LEVEL_CAMERA)
    classes = []
    for number, object_class in enumerate(DETECTED):
        config = BOX_CLASSES[object_class]
        least = config.keep_above if sure is None else sure
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
    import numpy as np

    from modt.geometry import transform_boxes
    from modt_desk.box_tracking.whole_tracks import TrackedBoxes

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


def _poses(arguments: argparse.Namespace, sequence: Detections, sequences: int) -> Float64 | None:
    """(n, 4, 4) T_world_camera of every frame of the sequence."""
    from modt.geometry import inverse
    from modt.sources import kitti_calibration, oxts
    from modt.sources.pose_source import read_poses

    given: Path | None = arguments.poses or arguments.oxts
    if given is None:
        return None
    if not given.is_dir() and sequences > 1:
        raise MisuseError(given, f"one file for {sequences} sequences", "give a folder with a file for each")
    path = given / f"{sequence.name}.txt" if given.is_dir() else given
    if not path.is_file():
        raise MisuseError(path, "is missing", "add it, or run without ego-motion")
    if arguments.poses:
        poses = read_poses(path)
    else:
        calib = path.parent.parent / "calib" / path.name
        T_imu_sensor = kitti_calibration.T_imu_sensor_of_sequence(calib)
        T_sensor_camera = inverse(kitti_calibration.camera_of_sequence(calib).T_camera_sensor)
        poses = oxts.poses(oxts.read_records(path)) @ T_imu_sensor @ T_sensor_camera
    if len(poses) < sequence.n_frames:
        raise MisuseError(path, f"{len(poses)} poses for {sequence.n_frames} frames", "give one a frame")
    return poses
