"""JSON Lines: one record per line, each with the name of its schema."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from modt.errors import MisuseError

MAX_QUOTED = 100
BROKEN = (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError)
"""Exceptions raised by the use of a record that lacks a value or has one of another kind."""


def fields_of(record: Any) -> dict[str, Any]:
    """Fields of a dataclass by their names, as the argument `default` of json.dumps.

    Every dataclass of a record is written by this function: its fields are the keys of the record, in their order.
    """
    return {name: getattr(record, name) for name in record.__dataclass_fields__}


def line(record: object) -> str:
    """Line of a record, which is a mapping or a dataclass.

    Raises:
        ValueError: a number is not finite.
    """
    return json.dumps(record, separators=(",", ":"), allow_nan=False, default=fields_of) + "\n"


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
