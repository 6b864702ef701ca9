"""tracks.jsonl: the tracks after every frame.

`frame_record` defines a line. `frame_line` writes the same line at a fraction of the cost, by table look-up.
"""

from __future__ import annotations

import json
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from modt.class_sizes import doubtful, unknown_near
from modt.classes import CLASS_NAMES
from modt.sinks import json_columns as text
from modt.sinks.records import line
from modt.types import NONE, Float64, FrameResult, Int

SCHEMA = "modt.frame/3"
BOX_KEYS = ("x", "y", "z", "l", "w", "h", "yaw")
UNKNOWN_NEAR = "unknown, near"  # may be a person, too near for the sensor to show enough of it
UNCERTAIN_NAMES = (None, *(f"{name}?" for name in CLASS_NAMES[1:]), UNKNOWN_NEAR)
WORLD_KEYS = ("x", "y", "heading", "speed_mps")


def frame_record(result: FrameResult) -> dict[str, Any]:
    """One result as plain data: lengths rounded to 1e-3, probabilities and the pose to 1e-6."""
    tracks = result.tracks
    tracked = tracks.proposal != NONE
    box = np.zeros((len(tracks), len(BOX_KEYS)))
    box[tracked] = result.proposals.box[tracks.proposal[tracked]]
    columns = {
        "id": tracks.id.tolist(),
        "state": [result.state_names[state] for state in tracks.state.tolist()],
        "class": [CLASS_NAMES[class_] for class_ in tracks.object_class.tolist()],
        "posterior": np.round(tracks.posterior, 6).tolist(),
        "witness": np.round(tracks.witness, 3).tolist(),
        "viewed": tracks.viewed.tolist(),
        "final": tracks.final.tolist(),
        "uncertain": [UNCERTAIN_NAMES[doubt] for doubt in _doubts(result).tolist()],
        "proposal": [None if proposal == NONE else proposal for proposal in tracks.proposal.tolist()],
        "points": tracks.points.tolist(),
        "age": tracks.age.tolist(),
        "missed": tracks.missed.tolist(),
        "box": [
            dict(zip(BOX_KEYS, row, strict=True)) if shown else None
            for row, shown in zip(np.round(box, 3).tolist(), tracked.tolist(), strict=True)
        ],
        "world": [dict(zip(WORLD_KEYS, row, strict=True)) for row in np.round(tracks.x, 3).tolist()],
    }
    rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    return _frame_fields(result) | {"tracks": rows}


def _doubts(result: FrameResult) -> Int:
    """(M,) index into UNCERTAIN_NAMES of each track."""
    named: Int = np.where(unknown_near(result), len(CLASS_NAMES), result.tracks.object_class * doubtful(result))
    return named


def _frame_fields(result: FrameResult) -> dict[str, Any]:
    """Fields of a record other than its tracks."""
    return {
        "schema": SCHEMA,
        "frame": result.frame.index,
        "stamp_s": round(result.frame.stamp_s, 6),
        "T_world_sensor": np.round(result.T_world_sensor[:3], 6).ravel().tolist(),
        "proposals": len(result.proposals),
        "classifications": len(result.classified),
        "deferred": result.n_deferred,
        "classified": result.classified.tolist(),
    }


def recorded_pose(record: dict[str, Any]) -> Float64:
    """(4, 4) T_world_sensor of a record.

    Raises:
        one of modt.sinks.records.BROKEN: the record has none.
    """
    T = np.eye(4)
    T[:3] = np.reshape(record["T_world_sensor"], (3, 4))
    if not np.isfinite(T).all():
        raise ValueError("T_world_sensor is not finite")
    return T


CLASSES = text.encode_table([json.dumps(name) for name in CLASS_NAMES])
UNCERTAIN = text.encode_table([json.dumps(name) for name in UNCERTAIN_NAMES])
BOOLEANS = text.encode_table(["false", "true"])
NULL = text.encode("null")[0]


class _LatestLine:
    """The line of the latest frame, which several sinks ask for one after the other."""

    result: FrameResult | None = None
    line = ""

    def of(self, result: FrameResult) -> str:
        if result is not self.result:
            self.line, self.result = _encoded(result), result
        return self.line


_latest = _LatestLine()


def frame_line(result: FrameResult) -> str:
    """The line of frame_record(result), character by character.

    Raises:
        ValueError: a number is not finite.
    """
    return _latest.of(result)


def _encoded(result: FrameResult) -> str:
    if not _in_tables(result):
        return line(frame_record(result))
    tracks = result.tracks
    counts = (tracks.id, np.maximum(tracks.proposal, 0), tracks.points, tracks.age, tracks.missed)
    id_, proposal, points, age, missed = text.integers(np.stack(counts))
    box = _objects(BOX_KEYS, text.rounded_to_3(result.proposals.box[tracks.proposal]))
    for value in (proposal, box):
        value[tracks.proposal == NONE] = 0
        value[tracks.proposal == NONE, 0] = NULL
    columns = {
        "id": id_,
        "state": _states(result.state_names)[tracks.state],
        "class": CLASSES[tracks.object_class],
        "posterior": _lists(text.probabilities(tracks.posterior)),
        "witness": _lists(text.rounded_to_3(tracks.witness)),
        "viewed": BOOLEANS[tracks.viewed.astype(np.int64)],
        "final": BOOLEANS[tracks.final.astype(np.int64)],
        "uncertain": UNCERTAIN[_doubts(result)],
        "proposal": proposal,
        "points": points,
        "age": age,
        "missed": missed,
        "box": box,
        "world": _objects(WORLD_KEYS, text.rounded_to_3(tracks.x)),
    }
    keyed = [part for key, column in columns.items() for part in (f',"{key}":', column)]
    keyed[0] = ',{"id":'
    rows = text.decode(text.join_columns(len(tracks), *keyed, "}"))
    return line(_frame_fields(result) | {"tracks": []}).replace('"tracks":[]', f'"tracks":[{rows[1:]}]')


def frame_parts(result: FrameResult, max_bytes: int) -> list[str]:
    """The line of a frame; where it is longer than that, lines of some of the tracks each.

    Parts have all fields of a frame, and `part`, from 0, and `parts`, their number.

    Raises:
        ValueError: a number is not finite.
    """
    whole = frame_line(result)
    if len(whole) <= max_bytes:
        return [whole]
    all_rows = np.arange(len(result.tracks))
    most = max(len(all_rows), 1)
    n = min(len(whole) // max_bytes + 1, most)
    while True:
        parts = [_part(result, rows, k, n) for k, rows in enumerate(np.array_split(all_rows, n))]
        if n == most or max(map(len, parts)) <= max_bytes:
            return parts
        n = min(n + n // 4 + 1, most)


def _part(result: FrameResult, rows: Int, number: int, parts: int) -> str:
    some = _encoded(replace(result, tracks=result.tracks.renewed(rows, 0)))
    return some.replace(',"tracks":[', f',"part":{number},"parts":{parts},"tracks":[', 1)


@lru_cache
def _states(names: tuple[str, ...]) -> text.Text:
    """(S, w) text of the names of the states."""
    return text.encode_table([json.dumps(name) for name in names])


def _in_tables(result: FrameResult) -> bool:
    """Whether the tables hold every number."""
    tracks, boxes = result.tracks, result.proposals.box
    lengths = all((np.abs(values) < text.LIMIT - 1).all() for values in (tracks.x, boxes))
    counts = all((values < text.LIMIT).all() for values in (tracks.id, tracks.points, tracks.age, tracks.missed))
    return bool(len(boxes) and lengths and counts and (np.abs(tracks.posterior - 0.5) <= 0.5).all())


def _objects(keys: tuple[str, ...], values: text.Text) -> text.Text:
    """(n, w) text of JSON objects with some keys and values (n, k, v)."""
    return _enclosed([f'{"," if k else "{"}"{key}":' for k, key in enumerate(keys)], values, "}")


def _lists(values: text.Text) -> text.Text:
    """(n, w) text of JSON lists of values (n, k, v)."""
    return _enclosed(["," if k else "[" for k in range(values.shape[1])], values, "]")


def _enclosed(prefixes: list[str], values: text.Text, end: str) -> text.Text:
    """(n, w) text of values (n, k, v), each after its prefix."""
    parts = [part for k, prefix in enumerate(prefixes) for part in (prefix, values[:, k])]
    return text.join_columns(len(values), *parts, end)
