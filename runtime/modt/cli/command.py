"""Subcommands of `modt` and `modt-profile`, and errors as one line."""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Sequence
from typing import Any, Protocol

from modt import __version__
from modt.errors import ModtError

INTERRUPTED = 130
"""Exit status after Ctrl-C, as in shells: 128 + SIGINT."""


class Command(Protocol):
    """A module with a subcommand; it sets `run` to a function of the parsed arguments that returns the status."""

    def add_parser(self, commands: Any, /) -> None:
        """Declare the command and its options."""
        ...


def dispatch(name: str, description: str, commands: Sequence[Command], argv: Sequence[str] | None) -> int:
    """Run a subcommand; returns the exit status: 0 success, 1 failure, 2 misuse, 130 interrupted."""
    top = argparse.ArgumentParser(prog=name, description=description)
    top.add_argument("--version", action="version", version=f"modt {__version__}")
    choice = top.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for command in commands:
        command.add_parser(choice)
    arguments = top.parse_args(argv)
    logging.basicConfig(level=logging.WARNING, format="modt: %(message)s", stream=sys.stderr)
    try:
        return int(arguments.run(arguments))
    except ModtError as error:
        print(f"modt: {error}", file=sys.stderr)
        return error.exit_status
    except BrokenPipeError:
        sys.stderr.close()
        return 1
    except KeyboardInterrupt:
        print("modt: interrupted; start it again", file=sys.stderr)
        return INTERRUPTED
