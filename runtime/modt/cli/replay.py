"""`modt replay`: process a stream, and write results and summary."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any

from modt import host
from modt.cli import options
from modt.cli.command import INTERRUPTED
from modt.errors import MisuseError

if TYPE_CHECKING:
    from modt.app.loop import Loop
    from modt.sinks.run_directory import RunDirectory


def add_parser(commands: options.Commands) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("replay", help="process a recorded stream, or the built-in synthetic one")
    options.add_stream_options(p)
    p.add_argument("others", nargs="*", type=Path, help=argparse.SUPPRESS)
    options.add(p, "fov")
    options.add(p, "out", default=None, help="run directory (default: runs/STREAM-MODE)")
    options.add(p, "mode")
    p.add_argument("--rate", type=rate, dest="rate_hz", metavar="HZ|max", help="frames a second (default: max)")
    motion = p.add_mutually_exclusive_group()
    file = "poses in KITTI odometry's format, instead of the recorded ones"
    motion.add_argument("--poses", type=Path, metavar="FILE", help=file)
    options.add(motion, "odometry")
    options.add(p, "sink")
    p.add_argument("--labels", action="store_true", help="write point labels in SemanticKITTI's encoding")
    p.add_argument("--quiet", action="store_true", help="no progress, no summary")
    options.add_examples(
        p,
        "modt replay                                        the built-in street",
        "modt replay DRIVE --frames 0:50 --out runs/a       part of a recording",
        "modt replay a.pcap --profile vlp-16 --sink -       packets of a Velodyne, tracks to standard output",
    )
    p.set_defaults(run=run)


def rate(text: str) -> float | None:
    """Frames a second, or None for no limit."""
    return None if text == "max" else options.bounded(float, 0.01, 1000, "frames a second, or max")(text)


def run(arguments: argparse.Namespace) -> int:
    """Replay; returns 0, or 3 if a part of what was asked for could not be read.

    SIGTERM ends it with this status, SIGINT with 130, both with complete records.
    """
    if arguments.others:
        remedy = "replay them one by one, or as one dataset by modt batch"
        raise MisuseError(arguments.others[0], "modt replay takes one recording", remedy)
    pinned = host.pin_to_core(arguments.core)
    # NumPy is imported from here on, after the process is pinned.
    from modt.app.build import replay
    from modt.app.inputs import Request
    from modt.app.systemd import notifier_of
    from modt.cli.progress import bar
    from modt.reporting.summary import summary_text
    from modt.schemes import open_sinks

    notifier = notifier_of(os.environ)
    sinks = open_sinks(arguments.sink)
    loop = replay(Request.of(arguments), sinks, arguments.out, pinned, ["modt", *sys.argv[1:]])
    info = loop.stages.info
    shown = not arguments.quiet
    if shown and (notes := [*info.notes, *info.pose_notes]):
        print("\n".join(f"modt: {note}" for note in notes), file=sys.stderr)
    with bar(info.n_frames, "frame", shown=shown) as step:
        summary = loop.run(notifier, lambda r: step(f"{len(r.proposals)} proposals, {len(r.classified)} classified"))
    if shown:
        print(summary_text(summary))
        print(_place(loop.recording.directory))
    return _ended(loop, summary)


def _ended(loop: Loop, summary: Mapping[str, Any]) -> int:
    """Say what was left out and what has ended the replay; returns the exit status."""
    from modt.app.account import PARTLY, closing_lines

    _say(closing_lines(summary["read"]))
    signal = loop.stop.signal
    if signal:
        whole = f"{summary['frames']} frames: {loop.recording.directory.path} is whole"
        _say([f"stopped by {signal} after {whole}"])
    if signal == "SIGINT":
        return INTERRUPTED
    return PARTLY if summary["read"]["left_out"] else 0


def _say(lines: Sequence[str]) -> None:
    for line in lines:
        print(f"modt: {line}", file=sys.stderr)


def _place(directory: RunDirectory) -> str:
    """Line about the place of the results."""
    kept = f"; those before are kept in {directory.previous}" if directory.previous else ""
    return f"  results in {directory.path}; to look at them: modt view {quote(str(directory.path))}{kept}"
