"""`modt replay`: a stream through the whole method, results and summary on disk."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from modt import host
from modt.cli.command import INTERRUPTED

MODES = ("conventional", "efficient", "accurate")


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("replay", help="run the method on a recorded or the embedded stream")
    p.add_argument("path", nargs="?", type=Path, metavar="PATH", help="KITTI drive, sequence or folder of .bin scans")
    p.add_argument("--out", type=Path, metavar="DIR", help="results go here (default: runs/STREAM-MODE)")
    p.add_argument("--mode", choices=MODES, default="accurate", help="default: %(default)s")
    p.add_argument(
        "--profile", default="hdl-64e", metavar="NAME|FILE", help="sensor and board (default: %(default)s)"
    )
    p.add_argument("--fov", choices=("camera", "full"), default="full", help="default: %(default)s")
    p.add_argument("--frames", type=frames, default=(0, None), metavar="A:B", help="frames from A up to, not with, B")
    p.add_argument("--rate", type=rate, default=None, metavar="HZ|max", help="frames a second (default: max)")
    p.add_argument(
        "--core", type=core, default="last", metavar="N|none", help="pin to core N (default: the last one)"
    )
    motion = p.add_mutually_exclusive_group()
    motion.add_argument(
        "--poses", type=Path, metavar="FILE", help="poses in KITTI odometry's format, for the stream's own"
    )
    motion.add_argument(
        "--odometry",
        default="recording",
        metavar="SOURCE",
        help="poses: recording (the stream's, default), none, or from a socket: udp://HOST:PORT, unix:///PATH",
    )
    p.add_argument("--labels", action="store_true", help="write point labels in SemanticKITTI's encoding")
    p.add_argument("--quiet", action="store_true", help="no progress, no summary")
    p.set_defaults(run=run)


def frames(text: str) -> tuple[int, int | None]:
    """A:B, either side may be left out."""
    first, colon, last = text.partition(":")
    try:
        a, b = int(first or 0), int(last) if last else None
    except ValueError:
        a, b = -1, None
    if not colon or a < 0 or (b is not None and b <= a):
        raise argparse.ArgumentTypeError(f"{text!r} is no range; write A:B with 0 <= A < B, as in 0:50")
    return a, b


def rate(text: str) -> float | None:
    """Frames a second, or None for as many as possible."""
    if text == "max":
        return None
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.01 <= value <= 1000:
        raise argparse.ArgumentTypeError(f"{text!r} is no rate; write frames a second from 0.01 to 1000, or max")
    return value


def core(text: str) -> int | None:
    """Number of a core, or None to leave the affinity alone."""
    if text == "last":
        return host.last_core()
    if text == "none":
        return None
    if not text.isdigit():
        raise argparse.ArgumentTypeError(f"{text!r} is no core; write its number, or none")
    return int(text)


def run(arguments: argparse.Namespace) -> int:
    """Replay; a signal that ends it leaves whole records, SIGTERM with exit status 0 and SIGINT with 130."""
    pinned = host.confine(arguments.core)
    # NumPy loads from here on, after the process is confined.
    from modt.cli.assemble import Request
    from modt.cli.progress import progress
    from modt.cli.session import Session
    from modt.reporting.summary_text import summary_table
    from modt.supervisor import supervisor_of

    request = Request(
        path=arguments.path,
        mode=arguments.mode,
        profile=arguments.profile,
        fov=arguments.fov,
        frames=arguments.frames,
        rate_hz=arguments.rate,
        labels=arguments.labels,
        odometry=arguments.odometry,
        poses=arguments.poses,
    )
    supervisor = supervisor_of(os.environ)
    session = Session(request, arguments.out, pinned, command=["modt", *sys.argv[1:]])
    show = not arguments.quiet
    if show:
        for note in session.notes:
            print(f"modt: {note}", file=sys.stderr)
    with progress(session.stream.info.n_frames, shown=show and sys.stderr.isatty()) as tick:
        summary = session.run(tick, supervisor)
    if show:
        print(summary_table(summary))
        print(f"  results in {session.directory.path}")
    stopped_by = session.stop.signal
    if stopped_by is not None:
        frames_done = f"after {summary['frames']} frames"
        print(f"modt: stopped by {stopped_by} {frames_done}: {session.directory.path} is whole", file=sys.stderr)
    return INTERRUPTED if stopped_by == "SIGINT" else 0
