"""`modt top`: the status of a running service, kept up to date."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from modt.cli.status import add_directory, read
from modt.errors import MisuseError

PERIOD_S = 1.0
"""That of the status."""
QUIT = "qQ\x04"


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("top", help="show what a running modt run is doing, until q is pressed")
    add_directory(p)
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Show the status until q or Ctrl-C; without a terminal print it once.

    Raises:
        MisuseError: there is no status at the start.
    """
    from modt.app.status_text import status_text

    directory = arguments.directory
    text = status_text(read(directory), time.time())
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        print(text)
        return 0
    from modt.cli.screen import full_screen  # termios is no part of Windows

    try:
        with full_screen(sys.stdin, sys.stdout) as screen:
            while True:
                screen.show([*text.splitlines(), "", "q ends"])
                if screen.key(PERIOD_S) in tuple(QUIT):
                    return 0
                text = _text(directory)
    except KeyboardInterrupt:
        return 0


def _text(directory: Path) -> str:
    from modt.app.status_text import status_text

    try:
        return status_text(read(directory), time.time())
    except MisuseError as error:  # another part of the records begins, or the service ends
        return str(error)
