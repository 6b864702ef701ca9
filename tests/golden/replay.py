"""Golden replays: what each mode does on a second of a synthetic street, to the track and the millimetre.

    python -m tests.golden.replay

writes them anew. Every changed number is a change of behaviour: look at the difference before you commit it.
`python -m tools.same_tracks` compares two commits byte by byte, on more sensors and scenes.

A line is a frame. Lists by track hold the track of every proposal, in the order of the proposals, then the lost ones.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from modt.app import assembly
from modt.classes import CLASSES
from modt.geometry import FieldOfView
from modt.profile import load
from modt.types import NONE, FrameResult
from modt_simulation.synthetic_stream import SyntheticStream

FOLDER = Path(__file__).parent
SENSOR = "vlp-16"
SECONDS = 1.0
_INITIALS = "bcpyBCPY"


def replay(mode_name: str) -> Iterator[FrameResult]:
    """Results of a mode on a synthetic street."""
    profile = load(SENSOR)
    mode = assembly.MODES[mode_name]
    pipeline = assembly.pipeline(mode, profile, FieldOfView())
    for frame in SyntheticStream("street", SENSOR, SECONDS, seed=7):
        yield pipeline.step(frame, mode.budget(profile))


def summary(result: FrameResult) -> dict[str, Any]:
    """A frame in plain numbers.

    frame, proposals, classifications, deferred, born: counts.
    id: id by track.
    points: number of points by proposal.
    state: digit of the state by track.
    class: initial of the class by track (Y: cyclist), a capital where it is final.
    box: box by id, of the tracks of objects: x, y, z, l, w, h [mm, sensor frame], yaw [mrad].
    box_sum: sum of the boxes of all proposals [mm, mrad].
    """
    tracks = result.tracks
    boxes = 1000 * result.proposals.box
    owner = tracks.row_of_proposal(len(result.proposals))
    rows = np.concatenate([owner, np.flatnonzero(tracks.proposal == NONE)])
    classes = zip(tracks.object_class[rows], tracks.final[rows], strict=True)
    objects = owner[tracks.object_class[owner] != 0]
    return {
        "frame": result.frame.index,
        "proposals": len(result.proposals),
        "classifications": len(result.classified),
        "deferred": result.n_deferred,
        "born": int(np.count_nonzero(tracks.age == 1)),
        "id": tracks.id[rows].tolist(),
        "points": result.proposals.count.tolist(),
        "state": "".join(map(str, tracks.state[rows])),
        "class": "".join(_INITIALS[c + len(CLASSES) * final] for c, final in classes),
        "box": {str(tracks.id[row]): np.rint(boxes[tracks.proposal[row]]).astype(int).tolist() for row in objects},
        "box_sum": np.rint(boxes.sum(axis=0)).astype(int).tolist(),
    }


def path(mode: str) -> Path:
    """File of the golden replay of a mode."""
    return FOLDER / f"street-{SENSOR}-{mode}.jsonl"


def main() -> None:
    """Write all golden replays."""
    for mode in assembly.MODES:
        lines = [json.dumps(summary(result), separators=(",", ":")) for result in replay(mode)]
        path(mode).write_text("".join(f"{line}\n" for line in lines))


if __name__ == "__main__":
    main()
