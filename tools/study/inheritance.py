"""What it saves, and what it costs, that new proposals inherit background from a place that is remembered.

    python -m tools.study.inheritance [--scene street crossing] [--seeds 0:4] [--seconds 10]
                         [--sensor hdl-64e] [--fov full]
                         [--mode efficient]

Every synthetic drive is played twice, with the memory and without. Of the proposals that are new and inherit, those
are wrong that are truly an object: most of their points are of a car, a pedestrian or a cyclist. They stay so until
the class is doubted (e7), the track ends or what it follows is no longer an object.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from modt.tracking.background_map import NoBackgroundMap

from modt.classes import CLASS_NAMES, ObjectClass
from modt.cli.assemble import MODES
from modt.sources.synthetic_stream import SyntheticStream
from modt.tracking.track_table import TrackTable
from modt.types import NONE, Int
from tools.study.truth_replay import Seen, add_drives, replay

PURE = 0.5
"""Share of a proposal's points that make it one of their body."""


@dataclass
class Tally:
    """Counts over drives.

    Attributes:
        proposals: seen.
        calls: proposals classified.
        born: tracks begun.
        objects_born: those that are truly an object.
        inherited: those that inherited background.
        wrong: those of them that are truly an object, by class.
        frames_wrong: for how long each of these was background by inheritance while it showed an object.
    """

    proposals: int = 0
    calls: int = 0
    born: int = 0
    objects_born: int = 0
    inherited: int = 0
    wrong: Counter[str] = field(default_factory=Counter)
    frames_wrong: list[int] = field(default_factory=list)

    def add(self, seen: Iterable[Seen], kind_of: Int) -> None:
        """One drive; kind_of (b,) is the true class of each body."""
        still_wrong: dict[int, int] = {}
        for s in seen:
            table = s.tracker.tracks
            assert isinstance(table, TrackTable)
            rows = np.flatnonzero(table.proposal != NONE)
            proposal = table.proposal[rows]
            sure = (s.body[proposal] != NONE) & (s.share[proposal] > PURE)
            class_ = np.where(sure, kind_of[s.body[proposal]], ObjectClass.BACKGROUND)
            object_ = class_ != ObjectClass.BACKGROUND
            new, inherits = table.age[rows] == 1, table.inherited[rows]
            self.proposals += len(s.result.proposals)
            self.calls += s.result.n_classified
            self.born += int(new.sum())
            self.objects_born += int((new & object_).sum())
            self.inherited += int((new & inherits).sum())
            wrong = set(table.id[rows[inherits & object_]].tolist())
            for id_ in wrong & set(still_wrong):
                still_wrong[id_] += 1
            gone = set(still_wrong) - wrong - set(table.id[table.proposal == NONE].tolist())
            self.frames_wrong += [still_wrong.pop(id_) for id_ in sorted(gone)]
            for id_, c in zip(table.id[rows], class_, strict=True):
                if int(id_) in wrong and table.age[table.id == id_][0] == 1:
                    self.wrong[CLASS_NAMES[c]] += 1
                    still_wrong[int(id_)] = 1
        self.frames_wrong += list(still_wrong.values())


def table_of(with_memory: Tally, without: Tally) -> str:
    """Both sides, as rows of a Markdown table."""
    m, frames = with_memory, np.array(with_memory.frames_wrong or [0])
    wrong = sum(m.wrong.values())

    def percent(a: float, b: float) -> str:
        return f"{100 * a / b:.1f} %" if b else "-"

    quartiles = " ".join(f"{q:.0f}" for q in np.percentile(frames, [25, 50, 75, 100]))
    rows = [
        ("new tracks, of them inheriting", f"{m.born}, {m.inherited} ({percent(m.inherited, m.born)})"),
        (
            "classifications with, without",
            f"{m.calls}, {without.calls} ({percent(without.calls - m.calls, without.calls)})",
        ),
        (
            "of all proposals, with, without",
            f"{percent(m.calls, m.proposals)}, {percent(without.calls, without.proposals)}",
        ),
        ("inheriting that are truly objects", f"{wrong} ({percent(wrong, m.inherited)})"),
        ("cars, pedestrians, cyclists", ", ".join(str(m.wrong[name]) for name in CLASS_NAMES[1:])),
        ("of the new tracks of objects", percent(wrong, m.objects_born)),
        ("frames wrong: quartiles, longest", quartiles),
    ]
    return "\n".join(f"| {name} | {value} |" for name, value in rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_drives(parser)
    parser.add_argument("--mode", choices=tuple(MODES), default="efficient")
    arguments = parser.parse_args()
    for scene in arguments.scene:
        with_memory, without = Tally(), Tally()
        for seed in range(*arguments.seeds):
            stream = SyntheticStream(scene, arguments.sensor, arguments.seconds, seed)
            kind_of = np.array([int(body.kind.object_class) for body in stream.simulator.world.bodies])
            for tally, background_map in ((with_memory, None), (without, NoBackgroundMap())):
                camera = arguments.fov == "camera"
                seen = replay(
                    stream, arguments.sensor, mode_name=arguments.mode, camera=camera, background_map=background_map
                )
                tally.add(seen, kind_of)
        print(f"{scene}, {arguments.fov}, {arguments.mode}, seeds {arguments.seeds[0]} to {arguments.seeds[1] - 1}")
        print(table_of(with_memory, without), flush=True)


if __name__ == "__main__":
    main()
