"""`modt track`: track the boxes of another detector."""

from __future__ import annotations

import argparse
import logging
from pathlib import Path

from modt.cli import options


def add_parser(commands: options.Commands) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("track", help="track the boxes of another detector")
    p.add_argument("detections", type=Path, nargs="+", metavar="DETECTIONS", help="file of a sequence, or a folder")
    p.add_argument("--out", type=Path, required=True, metavar="DIR", help="directory of the KITTI tracking results")
    motion = p.add_mutually_exclusive_group()
    file = "camera poses in KITTI odometry's format, or a folder"
    motion.add_argument("--poses", type=Path, metavar="FILE", help=file)
    motion.add_argument("--oxts", type=Path, metavar="DIR", help="folder of OXTS records, with calib/ beside it")
    seconds = options.bounded(float, 0.001, 10, "seconds")
    confidence = options.bounded(float, -1000, 1000, "a confidence")
    least = "least mean confidence of a track, or online its confidence in a frame (default: by type, for PointRCNN)"
    p.add_argument("--period", type=seconds, default=0.1, metavar="S", help="frame period [s] (default: %(default)g)")
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
    from modt_evaluation.box_tracking.detections import files, merge, read
    from modt_evaluation.box_tracking.sequences import camera_poses, track_sequence

    sequences = merge([read(files(path)) for path in arguments.detections])
    motions = [camera_poses(arguments.poses, arguments.oxts, sequence, len(sequences)) for sequence in sequences]
    with writing(arguments.out):
        arguments.out.mkdir(parents=True, exist_ok=True)
    frames = 0
    ids = 0
    spent_s = 0.0
    for sequence, poses in zip(sequences, motions, strict=True):
        began = time.process_time()
        text, n = track_sequence(sequence, poses, arguments.period, arguments.sure, online=arguments.online)
        spent_s += time.process_time() - began
        frames += sequence.n_frames
        ids += n
        lines = LineFile[str](arguments.out / f"{sequence.name}.txt")
        lines.write(text)
        lines.close()
    if not ids and any(map(len, sequences)):
        logging.getLogger("modt").warning("no track is confident enough; lower --sure to write more")
    if not arguments.quiet:
        rate = f"{frames / spent_s:.0f} frames a second of CPU time" if spent_s else "no time"
        print(f"{len(sequences)} sequences, {frames} frames, {ids} tracks, {rate}: {arguments.out}")
    return 0
