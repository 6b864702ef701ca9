"""tracks.jsonl: a line of JSON for the tracks after every frame."""

from __future__ import annotations

import json
from functools import lru_cache

import numpy as np

from modt.class_sizes import doubtful, unknown_near
from modt.classes import CLASS_NAMES
from modt.sinks import json_columns as text
from modt.sinks.records import line
from modt.types import NONE, FrameResult, Int

SCHEMA = "modt.frame/3"
BOX_KEYS = ("x", "y", "z", "l", "w", "h", "yaw")
WORLD_KEYS = ("x", "y", "heading", "speed_mps")
UNKNOWN_NEAR = "unknown, near"
"""May be a person, too near for the sensor to show enough of it."""
BOX, WORLD = ("{" + ",".join(f'"{key}":%r' for key in keys) + "}" for keys in (BOX_KEYS, WORLD_KEYS))
PER_CLASS = "[" + ",".join(["%r"] * len(CLASS_NAMES)) + "]"
TRACK = (
    f'{{"id":%d,"state":%s,"class":%s,"posterior":{PER_CLASS},"witness":{PER_CLASS},"viewed":%s,"final":%s,'
    f'"uncertain":%s,"proposal":%s,"points":%d,"age":%d,"missed":%d,"box":%s,"size":[%r,%r,%r],"world":{WORLD}}}'
)
"""Format of a track. Columns of text, `_by_columns`, give the same characters in a third of the CPU time."""
BOOLEANS, CLASSES = ("false", "true"), tuple(map(json.dumps, CLASS_NAMES))
UNCERTAIN = ("null", *(json.dumps(f"{name}?") for name in CLASS_NAMES[1:]), json.dumps(UNKNOWN_NEAR))
NUMBER_BYTES = 32
"""Room for the numbers in `part` and `parts` [bytes]."""


class _Latest:
    """Cache of the latest line, for several sinks of one frame."""

    result: FrameResult | None = None
    line = ""

    def of(self, result: FrameResult) -> str:
        if result is not self.result:
            rows = _by_columns(result) if _in_tables(result) else ",".join(_rows(result))
            self.line, self.result = f"{_head(result)},{_tracks(rows)}", result
        return self.line


_latest = _Latest()


def frame_line(result: FrameResult) -> str:
    """Line of a frame: lengths and log likelihoods rounded to 1e-3, probabilities and the pose to 1e-6.

    Raises:
        ValueError: a number is not finite.
    """
    return _latest.of(result)


def frame_parts(result: FrameResult, max_bytes: int) -> list[str]:
    """The line of a frame; where it is longer than that, lines of some of the tracks each.

    Parts have all fields of a frame, `part`, from 0, and `parts`, their number. A single track may be longer.

    Raises:
        ValueError: a number is not finite.
    """
    whole = frame_line(result)
    if len(whole) <= max_bytes:
        return [whole]
    head = _head(result)
    room = max_bytes - len(f'{head},"part":,"parts":,{_tracks("")}') - NUMBER_BYTES
    parts: list[list[str]] = [[]]
    left = room
    for row in _rows(result):
        left -= len(row) + 1
        if left < 0 and parts[-1]:
            parts.append([])
            left = room - len(row) - 1
        parts[-1].append(row)
    return [f'{head},"part":{k},"parts":{len(parts)},{_tracks(",".join(rows))}' for k, rows in enumerate(parts)]


def _head(result: FrameResult) -> str:
    """Line of a frame up to its tracks."""
    fields = {
        "schema": SCHEMA,
        "frame": result.frame.index,
        "stamp_s": round(result.frame.stamp_s, 6),
        "T_world_sensor": np.round(result.T_world_sensor[:3], 6).ravel().tolist(),
        "proposals": len(result.proposals),
        "classifications": len(result.classified),
        "deferred": result.n_deferred,
        "classified": result.classified.tolist(),
    }
    return line(fields)[: -len("}\n")]


def _tracks(rows: str) -> str:
    return f'"tracks":[{rows}]}}\n'


def _doubts(result: FrameResult) -> Int:
    """(M,) index into UNCERTAIN of each track."""
    doubt: Int = np.where(unknown_near(result), len(CLASS_NAMES), result.tracks.object_class * doubtful(result))
    return doubt


def _rows(result: FrameResult) -> list[str]:
    """JSON of each track."""
    tracks = result.tracks
    if not all(
        np.isfinite(values).all()
        for values in (tracks.posterior, tracks.witness, tracks.size_m, tracks.x, result.proposals.box)
    ):
        raise ValueError("JSON has no number that is not finite")
    states = tuple(map(json.dumps, result.state_names))
    boxes = [BOX % tuple(box) for box in np.round(result.proposals.box, 3).tolist()]
    boxes.append("null")  # index NONE is the last element
    columns = (
        tracks.id,
        tracks.state,
        tracks.object_class,
        np.round(tracks.posterior, 6),
        np.round(tracks.witness, 3),
        tracks.viewed,
        tracks.final,
        _doubts(result),
        tracks.proposal,
        tracks.points,
        tracks.age,
        tracks.missed,
        np.round(np.hstack([tracks.size_m, tracks.x]), 3),
    )
    return [
        TRACK
        % (
            *(id_, states[state], CLASSES[class_], *posterior, *witness, BOOLEANS[viewed], BOOLEANS[final]),
            *(
                UNCERTAIN[doubt],
                "null" if proposal == NONE else proposal,
                points,
                age,
                missed,
                boxes[proposal],
                *rest,
            ),
        )
        for id_, state, class_, posterior, witness, viewed, final, doubt, proposal, points, age, missed, rest in zip(
            *(column.tolist() for column in columns), strict=True
        )
    ]


TEXT_OF_CLASS, TEXT_OF_DOUBT, TEXT_OF_BOOLEAN = map(text.encode_table, (CLASSES, UNCERTAIN, BOOLEANS))
NULL = text.encode("null")[0]


def _in_tables(result: FrameResult) -> bool:
    """Whether the tables of text hold every number; false for numbers that are not finite."""
    tracks, boxes = result.tracks, result.proposals.box
    lengths = all(
        (np.abs(values) < text.LIMIT - 1).all() for values in (tracks.x, tracks.witness, tracks.size_m, boxes)
    )
    counts = all((values < text.LIMIT).all() for values in (tracks.id, tracks.points, tracks.age, tracks.missed))
    return bool(len(boxes) and lengths and counts and (np.abs(tracks.posterior - 0.5) <= 0.5).all())


def _by_columns(result: FrameResult) -> str:
    """The rows joined by commas, made column by column."""
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
        "class": TEXT_OF_CLASS[tracks.object_class],
        "posterior": _lists(text.probabilities(tracks.posterior)),
        "witness": _lists(text.rounded_to_3(tracks.witness)),
        "viewed": TEXT_OF_BOOLEAN[tracks.viewed.astype(np.int64)],
        "final": TEXT_OF_BOOLEAN[tracks.final.astype(np.int64)],
        "uncertain": TEXT_OF_DOUBT[_doubts(result)],
        "proposal": proposal,
        "points": points,
        "age": age,
        "missed": missed,
        "box": box,
        "size": _lists(text.rounded_to_3(tracks.size_m)),
        "world": _objects(WORLD_KEYS, text.rounded_to_3(tracks.x)),
    }
    keyed = [part for key, column in columns.items() for part in (f',"{key}":', column)]
    keyed[0] = ',{"id":'
    return text.decode(text.join_columns(len(tracks), *keyed, "}"))[1:]


@lru_cache
def _states(names: tuple[str, ...]) -> text.Text:
    """(S, w) text of the names of the states."""
    return text.encode_table([json.dumps(name) for name in names])


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
