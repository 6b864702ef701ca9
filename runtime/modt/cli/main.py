"""`modt`: the command line.

NumPy and ONNX Runtime size their thread pools when imported: commands import them after the process is pinned.
"""

from __future__ import annotations

from collections.abc import Sequence

from modt.cli.command import dispatch

COMMANDS = {
    "replay": "modt.cli.replay",
    "run": "modt.cli.run",
    "status": "modt.cli.status",
    "top": "modt.cli.status",
    "check": "modt.cli.check",
    "view": "modt_desk.cli.view",
    "evaluate": "modt_desk.cli.evaluate",
    "export": "modt_desk.cli.export",
    "simulate": "modt_desk.cli.simulate",
    "track": "modt_desk.cli.track",
    "profile": "modt_desk.cli.profile_group",
    "profiles": "modt_desk.cli.profile_group",
    "completion": "modt_desk.cli.completion",
    "service": "modt_desk.cli.service",
}
"""Module of each command. Nothing else in this package names modules of the desk."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; returns the exit status: 0 success, 1 failure, 2 misuse, 130 interrupted."""
    return dispatch("modt", "Detect, track and classify objects in a LiDAR stream.", COMMANDS, argv)


if __name__ == "__main__":
    raise SystemExit(main())
