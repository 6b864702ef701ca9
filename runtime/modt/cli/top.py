"""`modt top`: the status of a running service, kept up to date."""

from __future__ import annotations

import argparse
import shutil
import sys
import time
from contextlib import suppress

from modt.cli import options
from modt.cli.status import add_directory, read
from modt.errors import MisuseError

PERIOD_S = 1.0
"""Interval between two status files [s]."""
CLEAR = "\x1b[H\x1b[2J"


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("top", help="show what a running modt run is doing, until Ctrl-C is pressed")
    add_directory(p)
    options.add_examples(
        p,
        "modt top                 the service that records into runs/live",
        "modt top /var/lib/modt   another one",
    )
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Show the status until Ctrl-C; without a terminal print it once.

    Raises:
        MisuseError: there is no status at the start.
    """
    from modt.app.status import status_text

    text = status_text(read(arguments.directory), time.time())
    if not sys.stdout.isatty():
        print(text)
        return 0
    with suppress(KeyboardInterrupt):
        while True:
            rows = text.splitlines()[: shutil.get_terminal_size().lines - 1]
            print(CLEAR + "\n".join(rows), flush=True)
            time.sleep(PERIOD_S)
            try:
                text = status_text(read(arguments.directory), time.time())
            except MisuseError as error:  # another part of the records begins, or the service ends
                text = str(error)
    return 0
