"""Golden replays: the behaviour of the whole pipeline on short synthetic streams, in a form people can review.

    python -m tests.golden.replay

writes them anew. Look at the difference before you commit it: every changed number is a change of behaviour.
"""

from __future__ import annotations

import json
from pathlib import Path

from modt import assembly
from modt.classes import CLASS_NAMES
from modt.energy.ledger import NullLedger
from modt.geometry import FieldOfView
from modt.profile import load
from modt.sinks.tracks import frame_record
from modt.sources.synthetic_stream import SyntheticStream

FOLDER = Path(__file__).parent
SCENES = {"street-vlp-16": ("street", "vlp-16", "vlp-16"), "street-hdl-64e": ("street", "hdl-64e", "hdl-64e")}
SECONDS = 1.2
CASES = [(scene, mode) for scene in SCENES for mode in assembly.MODES]


def behaviour(scene: str, mode_name: str) -> list[dict[str, object]]:
    """What a replay did, frame by frame: counts, births, and the classes given; no coordinate, no probability."""
    world, sensor, profile_name = SCENES[scene]
    profile, mode = load(profile_name), assembly.MODES[mode_name]
    pipeline = assembly.pipeline(mode, profile, FieldOfView(), NullLedger())
    lines = []
    for frame in SyntheticStream(world, sensor, SECONDS, seed=7):
        record = frame_record(pipeline.step(frame, mode.budget(profile)))
        tracks = record["tracks"]
        lines.append(
            {
                "frame": record["frame"],
                "proposals": record["proposals"],
                "classifications": record["classifications"],
                "deferred": record["deferred"],
                "born": sum(t["age"] == 1 for t in tracks),
                "lost": sum(t["proposal"] is None for t in tracks),
                "final": sum(t["final"] for t in tracks),
                "classes": {c: sum(t["class"] == c for t in tracks) for c in CLASS_NAMES},
            }
        )
    return lines


def path(scene: str, mode: str) -> Path:
    """Where a golden replay is kept."""
    return FOLDER / f"{scene}-{mode}.jsonl"


def main() -> None:
    """Write all golden replays."""
    for scene, mode in CASES:
        lines = behaviour(scene, mode)
        path(scene, mode).write_text("".join(json.dumps(line) + "\n" for line in lines))


if __name__ == "__main__":
    main()
