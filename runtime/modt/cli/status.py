"""`modt status`: print the status of a service."""

from __future__ import annotations

import argparse
import json
import os
import time
from pathlib import Path
from typing import Any

from modt.cli import options
from modt.cli.run import OUT
from modt.errors import MisuseError, refuse_pipe

REMEDY = "give the run directory of a modt run"


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("status", help="say what a running modt run is doing")
    add_directory(p)
    p.add_argument("--json", action="store_true", help="print JSON")
    options.add_examples(
        p,
        "modt status                        the service that records into runs/live",
        "modt status /var/lib/modt --json   all fields of another one",
    )
    p.set_defaults(run=run)


def add_directory(p: argparse.ArgumentParser) -> None:
    """Add the run directory of the service."""
    run_directory = "its run directory (default: %(default)s)"
    p.add_argument("directory", nargs="?", type=Path, default=OUT, metavar="DIR", help=run_directory)


def run(arguments: argparse.Namespace) -> int:
    """Print the status; 0 while the service runs, else 1."""
    from modt.app.status import STALE_S, status_text
    from modt.sinks.records import records_of

    directory, now_s = arguments.directory, time.time()
    status = read(directory)
    with records_of(directory):
        text = json.dumps(status, indent=1) if arguments.json else status_text(status, now_s)
        stale = bool(now_s - status["time_s"] >= STALE_S)
    print(text)
    return int(stale)


def read(directory: Path) -> dict[str, Any]:
    """The status of a run: in memory while its disk cannot be written, else beside its records.

    Raises:
        MisuseError: there is none.
    """
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
