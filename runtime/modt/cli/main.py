"""`modt`: the command line.

Nothing heavy is imported before the process is confined to its core: NumPy and ONNX Runtime size their thread pools
as they load.
"""

from __future__ import annotations

from collections.abc import Sequence

from modt.cli import evaluate, replay, simulate, track
from modt.cli.command import dispatch

COMMANDS = (replay, evaluate, simulate, track)


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; returns the exit status: 0 well, 1 failed, 2 misused, 130 interrupted."""
    return dispatch("modt", "Finds and follows moving objects in a LiDAR stream.", COMMANDS, argv)


if __name__ == "__main__":
    raise SystemExit(main())
