"""Options that several commands share, and the types of their values."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

from modt import host
from modt.profile import DEFAULT

Parser = argparse.ArgumentParser


def add_stream_options(p: Parser, first_frames: tuple[int, int | None] = (0, None)) -> None:
    """Stream, frames, profile and core."""
    a, b = first_frames
    which = f"frames from A to B - 1 (default: {a}:{'' if b is None else b})"
    stream = "KITTI drive, sequence or folder of .bin scans (default: a synthetic stream)"
    p.add_argument("path", nargs="?", type=Path, metavar="PATH", help=stream)
    p.add_argument("--frames", type=frames, default=first_frames, metavar="A:B", help=which)
    add_profile_option(p)
    add_core_option(p)


def add_profile_option(p: Parser) -> None:
    """Profile."""
    sensor = f"sensor and board (default: {DEFAULT}, or what the first sweep shows)"
    p.add_argument("--profile", metavar="NAME|FILE", help=sensor)


def add_core_option(p: Parser) -> None:
    """Core."""
    p.add_argument("--core", type=core, default="last", metavar="N|none", help="pin to core N (default: the last)")


def add_fov_option(p: Parser) -> None:
    """Field of view."""
    p.add_argument("--fov", choices=("camera", "full"), default="full", help="field of view (default: %(default)s)")


def add_meter_option(p: Parser) -> None:
    """Meter."""
    p.add_argument("--meter", metavar="NAME", help="meter to read (default: the best)")


def add_report_options(p: Parser) -> None:
    """Formats of a report."""
    p.add_argument("--json", action="store_true", help="print JSON")
    p.add_argument("--html", type=Path, metavar="FILE", help="write an HTML page with plots")


def frames(text: str) -> tuple[int, int | None]:
    """A:B; either may be left out."""
    first, colon, last = text.partition(":")
    try:
        a, b = int(first or 0), int(last) if last else None
    except ValueError:
        a, b = -1, None
    if not colon or a < 0 or (b is not None and b <= a):
        raise argparse.ArgumentTypeError(f"{text!r} is not a range; write A:B with 0 <= A < B, as in 0:50")
    return a, b


def core(text: str) -> int | None:
    """Number of a core, or None to leave the affinity unchanged."""
    if text in ("last", "none"):
        return host.last_core() if text == "last" else None
    return integer(0, 65535, "the number of a core, or none")(text)


def integer(low: int, high: int, what: str) -> Callable[[str], int]:
    """Type of an integer within bounds."""

    def parse(text: str) -> int:
        if not text.isdecimal() or not low <= int(text) <= high:
            raise argparse.ArgumentTypeError(f"{text!r}: write {what}, from {low} to {high}")
        return int(text)

    return parse


def real(low: float, high: float, what: str) -> Callable[[str], float]:
    """Type of a number within bounds."""

    def parse(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text!r}: write {what}, from {low:g} to {high:g}")
        return value

    return parse
