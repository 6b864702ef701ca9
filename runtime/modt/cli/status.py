"""`modt status` and `modt top`: the status of a service, once or kept up to date."""

from __future__ import annotations

import argparse
import json
import os
import shutil
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from modt.cli import options
from modt.errors import MisuseError, refuse_pipe

REMEDY = "give the run directory of a modt run"
PERIOD_S = 1.0
"""Interval between two status files [s]."""
CLEAR = "\x1b[H\x1b[2J"


def add_parser(commands: options.Commands) -> None:
    """Declare both commands and their options."""
    p = commands.add_parser("status", help="print the status of a running service")
    q = commands.add_parser("top", help="show the status of a running service, until Ctrl-C is pressed")
    run_directory = "its run directory (default: %(default)s)"
    for command, function in ((p, run), (q, run_top)):
        command.add_argument(
            "directory", nargs="?", type=Path, default=options.OUT, metavar="DIR", help=run_directory
        )
        command.set_defaults(run=function)
    options.add(p, "json")
    options.add_examples(
        p,
        "modt status                            the service that records into runs/live",
        "modt status /var/lib/modt/run --json   as root: all fields of that of systemd",
    )
    options.add_examples(
        q,
        "modt top                     the service that records into runs/live",
        "modt top /var/lib/modt/run   as root: that of systemd",
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the status; 0 while the service runs, else 1."""
    from modt.app.status import STALE_S, Status, status_text
    from modt.sinks.records import records_of

    now_s = time.time()
    record = read(arguments.directory)
    with records_of(arguments.directory):
        status = Status.of(record)
        text = json.dumps(record, indent=1) if arguments.json else status_text(status, now_s)
        stale = bool(now_s - status.time_s >= STALE_S)
    print(text)
    return int(stale)


def read(directory: Path) -> dict[str, Any]:
    """The record of the status: in memory while the disk of the run cannot be written, else beside its records.

    Raises:
        MisuseError: there is none, or this user must not read it.
    """
    try:
        return _read(directory)
    except PermissionError as error:
        remedy = "read it as root: sudo modt status DIR"
        raise MisuseError(directory, f"cannot be entered ({error.strerror})", remedy) from None


def _read(directory: Path) -> dict[str, Any]:
    from modt.app.status import SCHEMA
    from modt.sinks.run_directory import status_paths

    beside, memory = status_paths(directory)
    place = next(folder for folder in (directory, *directory.absolute().parents) if folder.exists())
    owners = {os.getuid(), place.stat().st_uid}  # anybody may write to the folder in memory
    path = memory if memory.is_file() and memory.stat().st_uid in owners else beside
    refuse_pipe(path, REMEDY)
    try:
        status = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise MisuseError(path, f"no status ({error})", REMEDY) from None
    if not isinstance(status, dict) or status.get("schema") != SCHEMA:
        raise MisuseError(path, "another schema", f"this version reads {SCHEMA}")
    return status


def run_top(arguments: argparse.Namespace) -> int:
    """Show the status until Ctrl-C; without a terminal print it once.

    Raises:
        MisuseError: there is no status at the start.
    """
    text = _text(arguments.directory)
    if not sys.stdout.isatty():
        print(text)
        return 0
    with suppress(KeyboardInterrupt):
        while True:
            rows = text.splitlines()[: shutil.get_terminal_size().lines - 1]
            print(CLEAR + "\n".join(rows), flush=True)
            time.sleep(PERIOD_S)
            try:
                text = _text(arguments.directory)
            except MisuseError as error:  # another part of the records begins, or the service ends
                text = str(error)
    return 0


def _text(directory: Path) -> str:
    from modt.app.status import Status, status_text
    from modt.sinks.records import records_of

    record = read(directory)
    with records_of(directory):
        return status_text(Status.of(record), time.time())
