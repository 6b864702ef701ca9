"""Options that several commands share, and the types of their values."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from modt import host
from modt.profile import DEFAULT
from modt.schemes import SINKS

Parser = argparse.ArgumentParser
if TYPE_CHECKING:
    Commands = argparse._SubParsersAction[Parser]  # to which a command adds its parser
MODES = ("conventional", "efficient", "accurate")
OUT = Path("runs/live")
"""Run directory of a service."""


def capture(text: str) -> tuple[str, str]:
    """Parse KEY=VALUE of --capture; the reader of the recording knows its keys."""
    key, equals, value = text.partition("=")
    if not equals:
        raise argparse.ArgumentTypeError(f"{text!r}: write KEY=VALUE")
    return key, value


def frames(text: str) -> tuple[int, int | None]:
    """Parse a range A:B, either end of which may be left out."""
    first, colon, last = text.partition(":")
    with suppress(ValueError):
        a = int(first or 0)
        b = int(last) if last else None
        if colon and a >= 0 and (b is None or b > a):
            return a, b
    raise argparse.ArgumentTypeError(f"{text!r} is not a range; write A:B with 0 <= A < B, as in 0:50")


def core(text: str) -> int | None:
    """Parse the number of a core; None leaves the affinity unchanged."""
    if text in ("last", "none"):
        return host.last_core() if text == "last" else None
    return bounded(int, 0, 65535, "the number of a core, or none")(text)


N = TypeVar("N", bound=float)


def bounded(kind: type[N], low: N, high: N, what: str) -> Callable[[str], N]:
    """Parser of a number of a kind, int or float, within bounds."""

    def parse(text: str) -> N:
        with suppress(ValueError):
            if low <= (value := kind(text)) <= high:
                return value
        raise argparse.ArgumentTypeError(f"{text!r}: write {what}, from {low} to {high}")

    return parse


_REPEATABLE: dict[str, Any] = {"action": "append", "default": []}
_PROFILES = f"sensor, board; later ones win key by key (default: {DEFAULT}, or what the first sweep shows)"
_CAPTURE = (
    "of a PCAP file: model=MODEL, calibration=FILE of a Velodyne, calibration=FILE of a Hesai or RoboSense, "
    "metadata=FILE of an Ouster, host=ADDRESS and port=N of one of several sensors; of a ROS 2 recording: topic=NAME "
    "of the point clouds, frame=NAME of one of several sensors that share it, odometry=NAME of a topic of poses or "
    "transforms; repeatable"
)
_ODOMETRY = "poses: recording (those of the source, default), none, udp://HOST:PORT, unix:///PATH, ros2:///TOPIC"
_SINKS = f"send tracks to {', '.join(scheme.form for scheme in SINKS.values())}; repeatable"
SHARED: dict[str, dict[str, Any]] = {
    "capture": {"type": capture, **_REPEATABLE, "metavar": "KEY=VALUE", "help": _CAPTURE},
    "core": {"type": core, "default": "last", "metavar": "N|none", "help": "pin to core N (default: the last)"},
    "fov": {"choices": ("camera", "full"), "default": "full", "help": "field of view (default: %(default)s)"},
    "html": {"type": Path, "metavar": "FILE", "help": "write an HTML page with plots (extra view)"},
    "json": {"action": "store_true", "help": "print JSON"},
    "meter": {"metavar": "NAME", "help": "meter to read (default: the best)"},
    "mode": {"choices": MODES, "default": "accurate", "help": "default: %(default)s"},
    "odometry": {"default": "recording", "metavar": "SOURCE", "help": _ODOMETRY},
    "out": {"type": Path, "default": OUT, "metavar": "DIR", "help": "run directory (default: %(default)s)"},
    "profile": {**_REPEATABLE, "metavar": "NAME|FILE", "help": _PROFILES},
    "sink": {**_REPEATABLE, "metavar": "ADDRESS", "help": _SINKS},
}
"""Arguments of `add_argument` by the name of an option."""


def add(p: argparse._ActionsContainer, *names: str, **changes: Any) -> None:
    """Add SHARED options, with changes to their arguments."""
    for name in names:
        p.add_argument(f"--{name}", **{**SHARED[name], **changes})


def add_examples(p: Parser, *examples: str) -> None:
    """Add example lines to the end of the help."""
    p.formatter_class = argparse.RawDescriptionHelpFormatter
    p.epilog = "\n  ".join(["examples:", *examples])


def add_stream_options(p: Parser, first_frames: tuple[int, int | None] = (0, None)) -> None:
    """Add the options of a stream: path, capture, frames, profile and core."""
    stream = (
        "KITTI drive, scene of nuScenes, log of Argoverse 2, folder of .bin, .pcd or .ply scans, PCAP file, "
        "ROS 2 recording (default: a synthetic stream)"
    )
    p.add_argument("path", nargs="?", type=Path, metavar="PATH", help=stream)
    add(p, "capture")
    add_frames_option(p, first_frames)
    add(p, "profile", "core")


def add_frames_option(p: Parser, default: tuple[int, int | None] = (0, None)) -> None:
    """Add the range of frames."""
    a, b = default
    which = f"frames from A to B - 1 (default: {a}:{'' if b is None else b})"
    p.add_argument("--frames", type=frames, default=default, metavar="A:B", help=which)
