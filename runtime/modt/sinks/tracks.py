"""tracks.jsonl: a line of JSON for the tracks after every frame."""

from __future__ import annotations

import json

import numpy as np

from modt.class_sizes import unknown_near
from modt.classes import CLASS_NAMES
from modt.sinks.records import line
from modt.types import NONE, FrameResult

SCHEMA = "modt.frame/3"
BOX_KEYS = ("x", "y", "z", "l", "w", "h", "yaw")
WORLD_KEYS = ("x", "y", "heading", "speed_mps")
UNKNOWN_NEAR = "unknown, near"
"""May be a person, too near for the sensor to show enough of it."""
BOX, WORLD = ("{" + ",".join(f'"{key}":%r' for key in keys) + "}" for keys in (BOX_KEYS, WORLD_KEYS))
PER_CLASS = "[" + ",".join(["%r"] * len(CLASS_NAMES)) + "]"
TRACK = (
    f'{{"id":%d,"state":%s,"class":%s,"posterior":{PER_CLASS},"witness":{PER_CLASS},"viewed":%s,"final":%s,'
    f'"uncertain":%s,"proposal":%s,"points":%d,"age":%d,"missed":%d,"box":%s,"world":{WORLD}}}'
)
"""A track, written by one formatting; `json` would take twice the time."""
BOOLEANS, CLASSES = ("false", "true"), tuple(map(json.dumps, CLASS_NAMES))
UNCERTAIN = ("null", json.dumps(UNKNOWN_NEAR))
NUMBER_BYTES = 32
"""Room for the numbers in `part` and `parts` [bytes]."""


class _Latest:
    """Cache of the latest line, for several sinks of one frame."""

    result: FrameResult | None = None
    line = ""

    def of(self, result: FrameResult) -> str:
        if result is not self.result:
            self.line, self.result = f"{_head(result)},{_tracks(_rows(result))}", result
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
    room = max_bytes - len(f'{head},"part":,"parts":,{_tracks([])}') - NUMBER_BYTES
    parts: list[list[str]] = [[]]
    left = room
    for row in _rows(result):
        left -= len(row) + 1
        if left < 0 and parts[-1]:
            parts.append([])
            left = room - len(row) - 1
        parts[-1].append(row)
    return [f'{head},"part":{k},"parts":{len(parts)},{_tracks(rows)}' for k, rows in enumerate(parts)]


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


def _tracks(rows: list[str]) -> str:
    return f'"tracks":[{",".join(rows)}]}}\n'


def _rows(result: FrameResult) -> list[str]:
    """JSON of each track."""
    tracks = result.tracks
    if not all(
        np.isfinite(values).all() for values in (tracks.posterior, tracks.witness, tracks.x, result.proposals.box)
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
        unknown_near(result),
        tracks.proposal,
        tracks.points,
        tracks.age,
        tracks.missed,
        np.round(tracks.x, 3),
    )
    return [
        TRACK
        % (
            *(id_, states[state], CLASSES[class_], *posterior, *witness, BOOLEANS[viewed], BOOLEANS[final]),
            *(
                UNCERTAIN[near],
                "null" if proposal == NONE else proposal,
                points,
                age,
                missed,
                boxes[proposal],
                *world,
            ),
        )
        for id_, state, class_, posterior, witness, viewed, final, near, proposal, points, age, missed, world in zip(
            *(column.tolist() for column in columns), strict=True
        )
    ]
