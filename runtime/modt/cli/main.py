"""`modt`: the command line.

NumPy and ONNX Runtime size their thread pools when imported: commands import them after the process is pinned.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import entry_points

from modt.cli.command import dispatch

ROBOT_COMMANDS = {
    "replay": "modt.cli.replay",
    "run": "modt.cli.run",
    "status": "modt.cli.status",
    "top": "modt.cli.status",
    "check": "modt.cli.check",
}
"""Module of each command of the robot. Installed tools add theirs by entry points."""


def commands() -> dict[str, str]:
    """Module of every command by its name."""
    return ROBOT_COMMANDS | {entry.name: entry.value for entry in sorted(entry_points(group="modt.commands"))}


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; returns the exit status: 0 success, 1 failure, 2 misuse, 3 read in part, 130 interrupted."""
    return dispatch("modt", "Detect, track and classify objects in a LiDAR stream.", commands(), argv)


if __name__ == "__main__":
    raise SystemExit(main())
