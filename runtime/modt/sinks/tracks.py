"""tracks.jsonl: what was known after every frame.

`frame_record` says what a line holds. `frame_line` writes the same line at a fraction of the cost: nearly all of it
is numbers, and those of all tracks are looked up at once.
"""

from __future__ import annotations

import json
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from modt.classes import CLASS_NAMES
from modt.sinks.fast_json import LIMIT, Words, beside, probabilities, table, text, thousandths, whole, words
from modt.sinks.output import LineFile
from modt.sinks.records import line
from modt.types import NONE, FrameResult

SCHEMA = "modt.frame/3"
BOX_KEYS = ("x", "y", "z", "l", "w", "h", "yaw")
WORLD_KEYS = ("x", "y", "heading", "speed_mps")


def frame_record(result: FrameResult) -> dict[str, Any]:
    """One result as plain data: lengths to the millimetre, probabilities to six digits."""
    tracks, boxes = result.tracks, result.proposals.box
    seen = tracks.proposal != NONE
    shown = np.zeros((len(tracks), len(BOX_KEYS)))
    shown[seen] = boxes[tracks.proposal[seen]]
    columns = zip(
        tracks.id.tolist(),
        tracks.state.tolist(),
        tracks.object_class.tolist(),
        np.round(tracks.posterior, 6).tolist(),
        tracks.viewed.tolist(),
        tracks.final.tolist(),
        tracks.proposal.tolist(),
        tracks.points.tolist(),
        tracks.age.tolist(),
        tracks.missed.tolist(),
        np.round(shown, 3).tolist(),
        np.round(tracks.x, 3).tolist(),
        strict=True,
    )
    return _around(result) | {
        "tracks": [
            {
                "id": id_,
                "state": result.state_names[state],
                "class": CLASS_NAMES[class_],
                "posterior": posterior,
                "viewed": viewed,
                "final": final,
                "proposal": None if proposal == NONE else proposal,
                "points": points,
                "age": age,
                "missed": missed,
                "box": None if proposal == NONE else dict(zip(BOX_KEYS, box, strict=True)),
                "world": dict(zip(WORLD_KEYS, world, strict=True)),
            }
            for id_, state, class_, posterior, viewed, final, proposal, points, age, missed, box, world in columns
        ],
    }


def _around(result: FrameResult) -> dict[str, Any]:
    """What a record says of the frame itself."""
    return {
        "schema": SCHEMA,
        "frame": result.frame.index,
        "stamp_s": round(result.frame.stamp_s, 6),
        "proposals": len(result.proposals),
        "classifications": result.n_classified,
        "deferred": result.n_deferred,
    }


CLASSES = table([json.dumps(name) for name in CLASS_NAMES])
TRUTH = table(["false", "true"])
NULL = words("null")[0]


def frame_line(result: FrameResult) -> str:
    """The line of frame_record(result), the same to the last character.

    Raises:
        ValueError: something is not finite.
    """
    if not _in_tables(result):
        return line(frame_record(result))
    tracks, n = result.tracks, len(result.tracks)
    seen = tracks.proposal != NONE
    counts = (tracks.id, np.maximum(tracks.proposal, 0), tracks.points, tracks.age, tracks.missed)
    id_, proposal, points, age, missed = whole(np.stack(counts))
    box = _keyed(BOX_KEYS, thousandths(result.proposals.box[tracks.proposal]))
    for value in (proposal, box):
        value[~seen], value[~seen, 0] = 0, NULL
    lines = beside(
        n,
        *(
            ',{"id":',
            id_,
            ',"state":',
            _states(result.state_names)[tracks.state],
            ',"class":',
            CLASSES[tracks.object_class],
        ),
        *(
            ',"posterior":',
            _listed(probabilities(tracks.posterior)),
            ',"viewed":',
            TRUTH[tracks.viewed.astype(np.int64)],
            ',"final":',
            TRUTH[tracks.final.astype(np.int64)],
        ),
        *(',"proposal":', proposal, ',"points":', points, ',"age":', age, ',"missed":', missed),
        *(',"box":', box, ',"world":', _keyed(WORLD_KEYS, thousandths(tracks.x)), "}"),
    )
    around = line(_around(result) | {"tracks": []})
    return around.replace('"tracks":[]', f'"tracks":[{text(lines)[1:]}]')


@lru_cache
def _states(names: tuple[str, ...]) -> Words:
    """(S, w) words of the states' names."""
    return table([json.dumps(name) for name in names])


def _in_tables(result: FrameResult) -> bool:
    """Whether every number can be looked up."""
    tracks, boxes = result.tracks, result.proposals.box
    near = all((np.abs(lengths) < LIMIT - 1).all() for lengths in (tracks.x, boxes))
    few = all((numbers < LIMIT).all() for numbers in (tracks.id, tracks.points, tracks.age, tracks.missed))
    return bool(len(boxes) and near and few and (np.abs(tracks.posterior - 0.5) <= 0.5).all())


def _keyed(keys: tuple[str, ...], values: Words) -> Words:
    """(n, w) words of objects with these keys and values (n, k, v)."""
    marks = [f'{"," if k else "{"}"{key}":' for k, key in enumerate(keys)]
    return beside(len(values), *(piece for k, mark in enumerate(marks) for piece in (mark, values[:, k])), "}")


def _listed(values: Words) -> Words:
    """(n, w) words of lists of values (n, k, v)."""
    marks = ["," if k else "[" for k in range(values.shape[1])]
    return beside(len(values), *(piece for k, mark in enumerate(marks) for piece in (mark, values[:, k])), "]")


class TrackLines:
    """Writes tracks.jsonl."""

    def __init__(self, path: Path) -> None:
        self._lines = LineFile(path)

    def write(self, result: FrameResult) -> None:
        """Append one frame.

        Raises:
            ModtError: the file cannot be written.
        """
        self._lines.write(frame_line(result))

    def close(self) -> None:
        """No more will come."""
        self._lines.close()
