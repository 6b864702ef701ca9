"""Write the figures of README.md and docs/paper.md, all at one commit.

    python -m tools.docs.figures KITTI_ROOT [--further FILE] [--pandaset FOLDER] [--only readme|weather|paper]
        [--jobs N]

KITTI_ROOT holds drive 0005 (2011_09_26) with its tracklets, FILE is the table of objects that these leave out
(docs/evaluation.md), FOLDER a labelled PandaSet sequence. README.md takes four minutes of CPU time, half of them for
its table of weather, and docs/paper.md three minutes. Without FOLDER the table has no row of PandaSet.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from modt import host
from modt.classes import CLASS_NAMES
from modt_evaluation.engine import Engine
from modt_evaluation.evaluation import ALL, Evaluation, collect, evaluation
from modt_evaluation.experiments.catalogue import chosen
from modt_evaluation.experiments.drives import Drive, KittiDrive, completed, kitti_drives, simulated_drives
from modt_evaluation.experiments.markdown import commit, sources
from modt_evaluation.experiments.study import Study
from modt_evaluation.frame import JudgedFrame
from tools.docs.paper_page import NAMES, section
from tools.docs.sections import DOCS, update
from tools.options import parser
from tools.study import drives

README = DOCS.parent / "README.md"
MARK = "tools.docs.figures"
DRIVE = "0005"
SENSORS = {"hdl-64e": "HDL-64E", "os1-64": "OS1-64", "vlp-16": "VLP-16", "mid-360": "Mid-360"}
"""Simulated sensors of the table, and their names in it."""
SCENES = ("street", "crossing")
SEEDS = range(450, 453)
"""Seeds of the simulated drives of each sensor. No choice of this project is made on them."""
SECONDS = 6.0
"""Duration of each of them [s]."""
WEATHER_MARK = f"{MARK} weather"
WEATHER_SENSOR = "vlp-16"
WEATHERS = {
    "snow of 2.5 mm/h": ("weather", "snow:2.5"),
    "fog, 50 m of visibility": ("weather", "fog:50"),
    "dust, optical depth 1.5": ("weather", "dust:1.5"),
    "a gait of 6 degrees": ("gait", "6"),
}
"""Rows of the table of weather, and the option of `modt simulate` that makes their drives."""
PANDASET_PROFILE = "pandar64"
MODE = "accurate"
BASELINE = "conventional"
BESIDE = ("accurate", "efficient")
FIRST = 10
"""Frames whose CPU time is left out, while tracks begin."""
PROFILES = ((), ("paper",))
SIMULATED = 12
"""Number of simulated drives of the page on the paper."""
SIMULATED_S = 2.0
"""Duration of each of them [s]."""


def readme(engine: Engine, kitti: Path, further: Path | None, pandaset: Path | None) -> str:
    """Section of README.md: a row for each sensor, and two sentences on the KITTI drive."""
    lines = _head()
    for sensor, name in SENSORS.items():
        lines.append(_row(f"{name}, simulated", _simulated(engine, sensor)))
    if pandaset is not None:
        drive = drives.labelled(pandaset, PANDASET_PROFILE)
        lines.append(_row("Pandar64, PandaSet (development)", evaluation([drives.judged(drive, MODE)])))
    return "\n".join([*lines, "", *on_kitti(drives.labelled(kitti, further=further))])


def weather(engine: Engine) -> str:
    """Section of README.md on weather and gait: the scenes and seeds of the first table, with one sensor."""
    lines = _head()
    for about, (option, condition) in WEATHERS.items():
        name = f"{SENSORS[WEATHER_SENSOR]}, {about}: `--{option} {condition}`"
        lines.append(_row(name, _simulated(engine, WEATHER_SENSOR, **{option: condition})))
    return "\n".join(lines)


def _head() -> list[str]:
    kinds = "detected", "recall", "precision", "length"
    return [f"| at commit `{commit()}` | {' | '.join(kinds)} |", "|---|" + "---|" * len(kinds)]


def _simulated(engine: Engine, sensor: str, **conditions: str) -> Evaluation:
    """All simulated drives of a sensor in the same conditions, those of SyntheticStream."""
    judged = drives.judged_in_order(engine, SCENES, sensor, SECONDS, SEEDS, (MODE,), conditions)
    return evaluation([rows for (rows,) in judged])


def on_kitti(drive: drives.Drive) -> Iterator[str]:
    """Average precision and recall of mode MODE, and the CPU time of the modes beside that of BASELINE.

    All modes run on each frame, in random order.
    """
    steps = {name: drives.steps_of(name, drive.profile, drive.fov) for name in (BASELINE, *BESIDE)}
    cpu_ns: dict[str, list[int]] = {name: [] for name in steps}
    judged = []
    rng = np.random.default_rng(0)
    for frame, truth in drive.frames:
        for name in rng.permutation(list(steps)).tolist():
            began_ns = time.thread_time_ns()
            result = steps[name](frame)
            cpu_ns[name].append(time.thread_time_ns() - began_ns)
            if name == MODE:
                judged.append(JudgedFrame.of_result(result, truth, drive.fov))
    scores = evaluation([collect(judged, drive.rules)]).ranges[ALL].classification
    of = [scores[c] for c in CLASS_NAMES[1:]]
    precision = _shares([s.average_precision for s in of])
    recall = _shares([s.objects_called for s in of])
    yield f"On drive {DRIVE} of KITTI, in the camera's view, average precision is {precision} and the recall of all"
    yield f"{' / '.join(str(s.objects) for s in of)} labelled objects {recall}. CPU time there, relative to mode"
    shares = [f"{sum(cpu_ns[name][FIRST:]) / sum(cpu_ns[BASELINE][FIRST:]):.2f} (`{name}`)" for name in BESIDE]
    yield f"`{BASELINE}` in the same run: {', '.join(shares)}."


def _row(name: str, found: Evaluation) -> str:
    whole = found.ranges[ALL]
    tracks = found.tracks.get(ALL)
    detected = [whole.segmentation[c].recall if c in whole.segmentation else None for c in CLASS_NAMES[1:]]
    scores = [whole.classification[c] for c in CLASS_NAMES[1:]]
    length = None if tracks is None else tracks.life.ratio
    columns = detected, [s.recall for s in scores], [s.precision for s in scores], [length]
    return f"| {name} | {' | '.join(_shares(column) for column in columns)} |"


def _shares(values: Sequence[float | None]) -> str:
    return " / ".join("-" if share is None else f"{100 * share:.0f}" for share in values)


def paper_page(engine: Engine, drive: KittiDrive, further: Path | None) -> str:
    """Section of docs/paper.md."""
    shown: list[Drive] = [drive, *simulated_drives(SIMULATED, SIMULATED_S)]
    if further is not None:
        shown.insert(1, completed([drive], further))
    about = f"{sources(PROFILES)}; made by `python -m tools.docs.figures`."
    return section(Study(chosen(NAMES), shown, PROFILES).rows(engine, lambda name: None), about)


def main() -> None:
    options = parser(__doc__)
    options.add_argument("kitti", type=Path, metavar="KITTI_ROOT")
    options.add_argument("--further", type=Path, metavar="FILE")
    options.add_argument("--pandaset", type=Path, metavar="FOLDER")
    options.add_argument("--only", choices=("readme", "weather", "paper"))
    options.add_argument("--jobs", type=int, default=1, metavar="N", help="number of processes (default: 1)")
    args = options.parse_args()
    host.pin_to_core(None)
    drive = next((d for d in kitti_drives(args.kitti) if d.number == DRIVE and d.scans), None)
    if drive is None:
        options.error(f"{args.kitti}: no drive {DRIVE} with labels and sweeps")
    with Engine(args.jobs) as engine:
        if args.only in (None, "readme"):
            update(README, MARK, readme(engine, drive.path, args.further, args.pandaset))
        if args.only in (None, "readme", "weather"):
            update(README, WEATHER_MARK, weather(engine))
        if args.only in (None, "paper"):
            update(DOCS / "paper.md", MARK, paper_page(engine, drive, args.further))


if __name__ == "__main__":
    main()
