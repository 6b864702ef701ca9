"""Subcommands of `modt` and `modt-profile`, and errors as one line."""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Mapping, Sequence
from importlib import import_module

from modt import __version__
from modt.errors import MisuseError, ModtError

INTERRUPTED = 130
"""Exit status after Ctrl-C, as in shells: 128 + SIGINT."""


def dispatch(name: str, description: str, commands: Mapping[str, str], argv: Sequence[str] | None) -> int:
    """Run a subcommand; returns the exit status: 0 success, 1 failure, 2 misuse, 3 read in part, 130 interrupted.

    `commands` maps each command to its module. Only the module of the given command is imported. Its add_parser sets
    `run` to a function of the parsed arguments that returns the status. Without a command the help is printed and the
    status is 2.
    """
    words = sys.argv[1:] if argv is None else argv
    top = argparse.ArgumentParser(prog=name, description=description)
    top.add_argument("--version", action="version", version=f"modt {__version__}")
    choice = top.add_subparsers(dest="command", required=True, metavar="COMMAND")
    given = next(iter(words), "")
    logging.basicConfig(level=logging.WARNING, format="modt: %(message)s", stream=sys.stderr)
    try:
        for module in [commands[given]] if given in commands else dict.fromkeys(commands.values()):
            import_module(module).add_parser(choice)
        if not words:
            return show_help(top)
        arguments = top.parse_args(words)
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


def show_help(parser: argparse.ArgumentParser) -> int:
    """Print the help instead of running a command that is missing; returns the exit status."""
    parser.print_help()
    return MisuseError.exit_status
