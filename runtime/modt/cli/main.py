"""`modt`: the command line.

NumPy and ONNX Runtime size their thread pools when imported: commands import them after the process is pinned.
"""

from __future__ import annotations

from collections.abc import Sequence

from modt.cli import check, profiles, replay, run, status, top
from modt_desk.cli import evaluate, export, simulate, track, view
from modt.cli.command import dispatch

COMMANDS = (replay, run, status, top, check, view, evaluate, export, simulate, track, profiles)


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; returns the exit status: 0 success, 1 failure, 2 misuse, 130 interrupted."""
    return dispatch("modt", "Detect, track and classify objects in a LiDAR stream.", COMMANDS, argv)


if __name__ == "__main__":
    raise SystemExit(main())
