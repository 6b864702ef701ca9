"""`modt`: the command line.

Nothing heavy is imported before the process is confined to its core: NumPy and ONNX Runtime size their thread pools
as they load.
"""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Callable, Sequence

from modt import __version__
from modt.cli import replay, simulate, track
from modt.errors import ModtError

COMMANDS = (replay, simulate, track)


def parser() -> argparse.ArgumentParser:
    """The command line."""
    top = argparse.ArgumentParser(prog="modt", description="Finds and follows moving objects in a LiDAR stream.")
    top.add_argument("--version", action="version", version=f"modt {__version__}")
    commands = top.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for command in COMMANDS:
        command.add_parser(commands)
    return top


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; returns the exit status: 0 well, 1 failed, 2 misused."""
    arguments = parser().parse_args(argv)
    return guarded(lambda: int(arguments.run(arguments)))


def guarded(command: Callable[[], int]) -> int:
    """Run a command so that every error a user can act on is one line."""
    logging.basicConfig(level=logging.WARNING, format="modt: %(message)s", stream=sys.stderr)
    try:
        return command()
    except ModtError as error:
        print(f"modt: {error}", file=sys.stderr)
        return error.exit_status
    except BrokenPipeError:
        sys.stderr.close()
        return 1
    except KeyboardInterrupt:
        print("modt: interrupted before it could begin; start it again", file=sys.stderr)
        return 1


if __name__ == "__main__":
    raise SystemExit(main())
