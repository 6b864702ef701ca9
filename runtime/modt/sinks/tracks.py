"""tracks.jsonl: what was known after every frame."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from modt.sinks.records import JsonLines
from modt.types import CLASS_NAMES, NONE, FrameResult

SCHEMA = "modt.frame/1"
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
        tracks.posterior.argmax(axis=1).tolist(),
        np.round(tracks.posterior, 6).tolist(),
        tracks.fixed.tolist(),
        tracks.proposal.tolist(),
        tracks.points.tolist(),
        tracks.age.tolist(),
        tracks.missed.tolist(),
        np.round(shown, 3).tolist(),
        np.round(tracks.x, 3).tolist(),
        strict=True,
    )
    return {
        "schema": SCHEMA,
        "frame": result.frame.index,
        "stamp_s": round(result.frame.stamp_s, 6),
        "proposals": len(result.proposals),
        "classified": result.classified,
        "deferred": result.deferred,
        "tracks": [
            {
                "id": id_,
                "state": result.state_names[state],
                "class": CLASS_NAMES[class_],
                "posterior": posterior,
                "fixed": fixed,
                "proposal": None if proposal == NONE else proposal,
                "points": points,
                "age": age,
                "missed": missed,
                "box": None if proposal == NONE else dict(zip(BOX_KEYS, box, strict=True)),
                "world": dict(zip(WORLD_KEYS, world, strict=True)),
            }
            for id_, state, class_, posterior, fixed, proposal, points, age, missed, box, world in columns
        ],
    }


class TrackLines:
    """Writes tracks.jsonl, and hands the record on to whoever counts."""

    def __init__(self, path: Path) -> None:
        self._lines = JsonLines(path)
        self.last: dict[str, Any] = {}

    def write(self, result: FrameResult) -> None:
        """Append one frame.

        Raises:
            ModtError: the file cannot be written.
        """
        self.last = frame_record(result)
        self._lines.write(self.last)

    def close(self) -> None:
        """No more will come."""
        self._lines.close()
