"""Records as JSON Lines: one object a line, each with its schema's name."""

from __future__ import annotations

import json
import logging
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

from modt.errors import MisuseError
from modt.sinks.output import LineFile

log = logging.getLogger(__name__)


def line(record: dict[str, Any]) -> str:
    """The line of a record.

    Raises:
        ValueError: a number is not finite.
    """
    return json.dumps(record, separators=(",", ":"), allow_nan=False) + "\n"


class JsonLines:
    """A growing file of records."""

    def __init__(self, path: Path) -> None:
        self._lines = LineFile(path)

    def write(self, record: dict[str, Any]) -> None:
        """Append one record.

        Raises:
            ModtError: the file cannot be written.
        """
        self._lines.write(line(record))

    def close(self) -> None:
        """No more will come."""
        self._lines.close()


def read_records(path: Path, schema: str, beside: Collection[str] = ()) -> Iterator[dict[str, Any]]:
    """Records of a file, in order; a last line cut short by a killed run is left out.

    Args:
        path: a file that JsonLines wrote, complete or still growing.
        schema: the schema's name that every record must bear.
        beside: schemas of other records in the file, which are passed over.

    Raises:
        MisuseError: missing, unreadable, or not of this schema; it names the line.
    """
    try:
        with path.open(encoding="utf-8") as lines:
            for number, text in enumerate(lines, 1):
                try:
                    record = json.loads(text)
                except json.JSONDecodeError:
                    if text.endswith("\n"):
                        raise MisuseError(f"{path}:{number}", "no JSON", "give a file that modt wrote") from None
                    log.warning("%s:%d: last line cut short, left out", path, number)
                    return
                found = record.get("schema") if isinstance(record, dict) else None
                if found in beside:
                    continue
                if found != schema:
                    remedy = f"this version reads {schema}"
                    raise MisuseError(f"{path}:{number}", f"schema is {found!r}", remedy)
                yield record
    except (OSError, UnicodeDecodeError) as error:
        raise MisuseError(path, f"cannot be read ({error})", "give the directory of a run") from None
