"""tracks.jsonl: a line of JSON for the tracks after every frame."""

from __future__ import annotations

import json
from functools import lru_cache

import numpy as np

from modt.class_sizes import doubtful, unknown_near
from modt.classes import CLASS_NAMES
from modt.geometry import inverse, transform_boxes
from modt.sinks import json_columns as text
from modt.sinks.records import line
from modt.types import MOTION_NAMES, NONE, FrameResult, Int

SCHEMA = "modt.frame/4"
BOX_KEYS = ("x", "y", "z", "l", "w", "h", "yaw")
WORLD_KEYS = ("x", "y", "heading", "speed_mps")
UNKNOWN_NEAR = "unknown, near"
"""Value of `uncertain` for a track that may be a person too near to be seen whole."""
BOOLEANS = (False, True)
UNCERTAIN = (None, *(f"{name}?" for name in CLASS_NAMES[1:]), UNKNOWN_NEAR)
NUMBER_BYTES = 32
"""Room for the numbers in `part` and `parts` [bytes]."""


class _Latest:
    """Cache of the latest line, for several sinks of one frame."""

    result: FrameResult | None = None
    line = ""

    def of(self, result: FrameResult) -> str:
        if result is not self.result:
            self.line = f"{_head(result)},{_tracks(text.decode(_rows(result)))}"
            self.result = result
        return self.line


_latest = _Latest()


def frame_line(result: FrameResult) -> str:
    """Line of a frame: stamp, pose and posterior rounded to 1e-6, other numbers to 1e-3.

    Raises:
        ValueError: a number is not finite.
    """
    return _latest.of(result)


def frame_parts(result: FrameResult, max_bytes: int) -> list[str]:
    """The line of a frame, or lines of parts of its tracks if it is longer than `max_bytes`.

    Each part has all fields of a frame, `part`, which counts from 0, and `parts`, the number of parts. A part with a
    single track may be longer than `max_bytes`.

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
    for row in map(text.decode, _rows(result)):
        left -= len(row)
        if left < 0 and parts[-1]:
            parts.append([])
            left = room - len(row)
        parts[-1].append(row)
    return [f'{head},"part":{k},"parts":{len(parts)},{_tracks("".join(rows))}' for k, rows in enumerate(parts)]


def _head(result: FrameResult) -> str:
    """Line of a frame up to its tracks."""
    fields = {
        "schema": SCHEMA,
        "run": result.run_id or None,
        "frame": result.frame.index,
        "stamp_s": round(result.frame.stamp_s, 6),
        "T_world_sensor": np.round(result.T_world_sensor[:3], 6).ravel().tolist(),
        "trust": result.trust.record(),
        "proposals": len(result.proposals),
        "classifications": len(result.classified),
        "deferred": result.n_deferred,
        "classified": result.classified.tolist(),
    }
    return line(fields)[: -len("}\n")]


def _tracks(rows: str) -> str:
    """End of a line, with the rows of its tracks."""
    return f'"tracks":[{rows[1:]}]}}\n'


def _doubts(result: FrameResult) -> Int:
    """(M,) index into UNCERTAIN of each track."""
    return np.asarray(np.where(unknown_near(result), len(CLASS_NAMES), result.tracks.object_class * doubtful(result)))


def _rows(result: FrameResult) -> text.Text:
    """(M, w) text of the JSON of each track, made column by column. Each row begins with a comma.

    Raises:
        ValueError: a number is not finite.
    """
    tracks = result.tracks
    lost = tracks.proposal == NONE
    counts = (tracks.id, np.maximum(tracks.proposal, 0), tracks.points, tracks.age, tracks.missed)
    id_, proposal, points, age, missed = text.integers(np.stack(counts))
    boxes = transform_boxes(inverse(result.T_world_sensor), tracks.whole_box)
    box = _group(text.rounded_to_3(boxes), BOX_KEYS)
    boxes_seen = np.zeros((len(tracks), len(BOX_KEYS)))
    boxes_seen[~lost] = result.proposals.box[tracks.proposal[~lost]]
    seen = _group(text.rounded_to_3(boxes_seen), BOX_KEYS)
    for value in (proposal, box, seen):
        value[lost] = 0
        value[lost, 0] = NULL
    covariance = tracks.velocity_covariance.reshape(-1, 4)[:, [0, 1, 3]]  # xx, xy, yy
    columns = {
        "id": id_,
        "state": _words(result.state_names)[tracks.state],
        "class": _words(CLASS_NAMES)[tracks.object_class],
        "posterior": _group(text.probabilities(tracks.posterior)),
        "witness": _group(text.rounded_to_3(tracks.motion_evidence)),
        "viewed": _words(BOOLEANS)[tracks.viewed.astype(np.int64)],
        "final": _words(BOOLEANS)[tracks.final.astype(np.int64)],
        "uncertain": _words(UNCERTAIN)[_doubts(result)],
        "proposal": proposal,
        "points": points,
        "age": age,
        "missed": missed,
        "box": box,
        "heading_known": _words(BOOLEANS)[tracks.heading_known.astype(np.int64)],
        "seen": seen,
        "size": _group(text.rounded_to_3(tracks.size_m)),
        "world": _group(text.rounded_to_3(tracks.x), WORLD_KEYS),
        "motion": _words(MOTION_NAMES)[tracks.motion],
        "moving": text.rounded_to_3(tracks.moving_probability),
        "velocity": _group(text.rounded_to_3(tracks.velocity)),
        "velocity_covariance": _group(text.rounded_to_3(covariance)),
    }
    keyed = [part for key, column in columns.items() for part in (f',"{key}":', column)]
    keyed[0] = ',{"id":'
    return text.join_columns(len(tracks), *keyed, "}")


@lru_cache
def _words(words: tuple[str | bool | None, ...]) -> text.Text:
    """(n, w) text of the JSON of words."""
    return text.encode_table([json.dumps(word) for word in words])


NULL = text.encode("null")[0]


def _group(values: text.Text, keys: tuple[str, ...] = ()) -> text.Text:
    """(n, w) text of JSON lists of values (n, k, v), or of objects with these keys."""
    names = [f'"{key}":' for key in keys] or [""] * values.shape[1]
    begin, end = "{}" if keys else "[]"
    parts = [part for k, name in enumerate(names) for part in (("," if k else begin) + name, values[:, k])]
    return text.join_columns(len(values), *parts, end)
