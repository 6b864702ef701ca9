"""Tracks as a CSV table: a row a track and frame."""

from __future__ import annotations

import csv
import io
from typing import Any

from modt.classes import CLASS_NAMES
from modt.sinks.tracks import BOX_KEYS, WORLD_KEYS

PLAIN = ("id", "state", "class", "viewed", "final", "proposal", "points", "age", "missed")
"""Columns that are called as in tracks.jsonl."""
UNITS = {"yaw": "rad", "heading": "rad", "speed_mps": ""}  # of the others: m
NO_BOX = dict.fromkeys(BOX_KEYS)


def _column(key: str) -> str:
    unit = UNITS.get(key, "m")
    return f"{key}_{unit}" if unit else key


COLUMNS = (
    "frame",
    "stamp_s",
    *PLAIN,
    *(f"p_{name}" for name in CLASS_NAMES),
    *(f"box_{_column(key)}" for key in BOX_KEYS),
    *(f"world_{_column(key)}" for key in WORLD_KEYS),
)


def track_rows(record: dict[str, Any]) -> str:
    """The rows of a line of tracks.jsonl. Null becomes an empty cell, booleans 0 and 1.

    Raises:
        KeyError, TypeError: the record is incomplete.
    """
    when = (record["frame"], record["stamp_s"])
    return _text([(*when, *_cells(track)) for track in record["tracks"]])


def _cells(track: dict[str, Any]) -> list[Any]:
    plain = [int(track[key]) if isinstance(track[key], bool) else track[key] for key in PLAIN]
    box, world = track["box"] or NO_BOX, track["world"]
    return [*plain, *track["posterior"], *(box[key] for key in BOX_KEYS), *(world[key] for key in WORLD_KEYS)]


def _text(rows: list[Any]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


HEADER = _text([COLUMNS])
"""The first line of a table."""
