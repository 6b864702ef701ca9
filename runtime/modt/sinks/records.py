"""JSON Lines: one record per line, each with the name of its schema."""

from __future__ import annotations

import json
import logging
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from modt.errors import MisuseError, refuse_pipe

log = logging.getLogger(__name__)

MAX_QUOTED = 100
BROKEN = (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError)
"""Exceptions raised by the use of a record that lacks a value or has one of another kind."""


def line(record: dict[str, Any]) -> str:
    """Line of a record.

    Raises:
        ValueError: a number is not finite.
    """
    return json.dumps(record, separators=(",", ":"), allow_nan=False) + "\n"


def read_records(path: Path, schema: str, ignored: Collection[str] = ()) -> Iterator[dict[str, Any]]:
    """Records of a schema, in order, without an incomplete last line of an aborted run.

    The file may still be growing; records of ignored schemas are skipped.

    Raises:
        MisuseError: missing, unreadable, or of another schema; the error names the line.
    """
    try:
        refuse_pipe(path, "give the directory of a run")
        with path.open(encoding="utf-8") as lines:
            for number, text in enumerate(lines, 1):
                try:
                    record = json.loads(text)
                except (ValueError, RecursionError):
                    if text.endswith("\n"):
                        raise MisuseError(f"{path}:{number}", "no JSON", "give a file that modt wrote") from None
                    log.warning("%s:%d: incomplete last line ignored", path, number)
                    return
                found = record.get("schema") if isinstance(record, dict) else None
                if found in ignored:
                    continue
                if found != schema:
                    remedy = f"this version reads {schema}"
                    raise MisuseError(f"{path}:{number}", f"schema is {found!r}", remedy)
                yield record
    except (OSError, UnicodeDecodeError) as error:
        raise MisuseError(path, f"cannot be read ({error})", "give the directory of a run") from None


@contextmanager
def records_of(path: Path) -> Iterator[None]:
    """Convert the failure of using a broken record to an error of its file or folder.

    Raises:
        MisuseError: a record lacks a value, or has one of another kind.
    """
    try:
        yield
    except BROKEN as error:
        cause = f"holds a record that modt did not write ({type(error).__name__}: {str(error)[:MAX_QUOTED]!r})"
        raise MisuseError(path, cause, "give what a run of this version wrote") from error
