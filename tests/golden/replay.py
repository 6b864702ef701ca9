"""Golden replays: the behaviour of the whole pipeline on short synthetic streams, to the track and the millimetre.

    python -m tests.golden.replay

writes them anew. Every changed number is a change of behaviour: look at the difference before you commit it.

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
SCENES = {"street-vlp-16": ("street", "vlp-16", "vlp-16"), "street-hdl-64e": ("street", "hdl-64e", "hdl-64e")}
SECONDS = 1.0
_INITIALS = "bcpyBCPY"
CASES = [(scene, mode) for scene in SCENES for mode in assembly.MODES]


def replay(scene: str, mode_name: str) -> Iterator[FrameResult]:
    """Results of a mode on a scene."""
    world, sensor, profile_name = SCENES[scene]
    profile = load(profile_name)
    mode = assembly.MODES[mode_name]
    pipeline = assembly.pipeline(mode, profile, FieldOfView())
    for frame in SyntheticStream(world, sensor, SECONDS, seed=7):
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


def differences(found: dict[str, Any], expected: dict[str, Any], tolerance: int = 1) -> list[str]:
    """Fields that differ between two frames: integers at all, boxes by more than a tolerance [mm, mrad]."""
    keys = found.keys() | expected.keys()
    different = [key for key in keys - {"box", "box_sum"} if found.get(key) != expected.get(key)]
    if found["box"].keys() != expected["box"].keys():
        return [*different, "box"]
    different += [f"box of {k}" for k, box in expected["box"].items() if _apart(found["box"][k], box) > tolerance]
    if _apart(found["box_sum"], expected["box_sum"]) > tolerance * max(1, expected["proposals"]):
        different.append("box_sum")
    return sorted(different)


def _apart(a: list[int], b: list[int]) -> int:
    return max(abs(x - y) for x, y in zip(a, b, strict=True))


def path(scene: str, mode: str) -> Path:
    """Where a golden replay is kept."""
    return FOLDER / f"{scene}-{mode}.jsonl"


def read(scene: str, mode: str) -> list[dict[str, Any]]:
    """The golden frames of a case."""
    return [json.loads(line) for line in path(scene, mode).read_text().splitlines()]


def main() -> None:
    """Write all golden replays."""
    for scene, mode in CASES:
        lines = [json.dumps(summary(result), separators=(",", ":")) for result in replay(scene, mode)]
        path(scene, mode).write_text("".join(f"{line}\n" for line in lines))


if __name__ == "__main__":
    main()
