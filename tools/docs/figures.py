"""Make the figures of README.md and docs/paper.md anew, all at one commit.

    python -m tools.docs.figures KITTI_ROOT [--further FILE] [--pandaset FOLDER] [--only readme|paper]

KITTI_ROOT holds drive 0005 (2011_09_26) with its tracklets, FILE is the table of objects that these leave out
(docs/evaluation.md), FOLDER a labelled PandaSet sequence. It takes some minutes. What is not given has no row.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np

from modt import host
from modt.app import assembly
from modt.config import ProfileConfig
from modt.config.segmentation import NATIVE
from modt.config.segmentation import NUMPY as NUMPY_KERNELS
from modt.geometry import FieldOfView
from modt.pipeline import Pipeline
from modt.profile import load
from modt.types import Budget, Frame, FrameResult
from modt_desk.evaluation.evaluation import ALL, Evaluation, collect, evaluation
from modt_desk.evaluation.frame import JudgedFrame
from modt_desk.evaluation.further_objects import with_further
from modt_desk.evaluation.truth import KITTI_TYPES, Truth
from modt_desk.evaluation.truth_files import open_truth
from modt_desk.experiments.catalogue import chosen
from modt_desk.experiments.drives import Drive, KittiDrive, completed, kitti_drives, simulated_drives
from modt_desk.experiments.markdown import commit, sources
from modt_desk.experiments.study import Study
from tools.docs.paper_page import NAMES, section
from tools.docs.sections import replace_section
from tools.options import parser
from tools.study import drives, sensors

ROOT = Path(__file__).resolve().parents[2]
MARK = "tools.docs.figures"
DRIVE = "0005"
SENSORS = {"hdl-64e": "HDL-64E", "os1-64": "OS1-64", "vlp-16": "VLP-16", "mid-360": "Mid-360"}
SEEDS, SCENES, SECONDS = range(450, 453), ("street", "crossing"), 6.0
"""Simulated drives of the table by sensor, on which nothing is settled."""
PANDASET_PROFILE = "pandar64"
MODES = ("conventional", "efficient", "accurate")
FIRST = 10
"""Frames without a time, while tracks begin."""
PROFILES = ((), ("paper",))
SIMULATED, SIMULATED_S = 12, 2.0
"""Simulated drives of the page on the paper, and how long each is [s]."""
THE_PAPER = {"cpu": "291 ms", "labels": "94 / 73 / 91 %"}
"""Segmentation and classification of a frame; average precision over eight drives (Table V)."""


def by_sensor(pandaset: Path | None) -> Iterator[str]:
    """Found, called, precision and life of mode `accurate`, a row for each sensor."""
    yield "| | found | called | precision of what is called | life |"
    yield "|---|---|---|---|---|"
    for sensor, name in SENSORS.items():
        made = [drives.simulated(scene, sensor, SECONDS, seed) for seed in SEEDS for scene in SCENES]
        found = [sensors.run(drive, drive.profile, "accurate", drive.fov, k) for k, drive in enumerate(made)]
        yield _sensor_row(f"{name}, simulated", evaluation(found))
    if pandaset is not None:
        drive = drives.labelled(pandaset, PANDASET_PROFILE)
        found = [sensors.run(drive, drive.profile, "accurate", drive.fov, 0)]
        yield _sensor_row(f"Pandar64, PandaSet, {len(drive.frames)} sweeps", evaluation(found))


def _sensor_row(name: str, found: Evaluation) -> str:
    whole = found.ranges[ALL]
    scores = [whole.classification[c] for c in sensors.CLASSES]
    recalls = [whole.segmentation[c].recall if c in whole.segmentation else None for c in sensors.CLASSES]
    columns = (recalls, [s.recall for s in scores], [s.precision for s in scores])
    tracks = found.tracks.get(ALL)
    life = "-" if tracks is None else _percent(tracks.life.ratio)
    return f"| {name} | {' | '.join(_shares(column) for column in columns)} | {life} |"


def by_mode(drive: KittiDrive, further: Path | None) -> Iterator[str]:
    """Cost and accuracy of the modes on a drive in its camera's view, beside the paper's."""
    labels = open_truth(drive.path)
    truths = {"labels": labels}
    if further is not None:
        truths = {"complete": with_further(labels, further, KITTI_TYPES), **truths}
    fov, frames = drive.fov(), [frame for frame, _ in drive.sweeps()]
    results, cpu_ms = _run(frames, fov)
    yield f"| | {' | '.join(MODES)} | the paper |"
    yield "|---|" + "---|" * (len(MODES) + 1)
    for kernels, name in ((NATIVE, "CPU time a frame"), (NUMPY_KERNELS, "the same on NumPy alone")):
        own = [f"{cpu_ms[mode, kernels]:.1f} ms" for mode in MODES]
        yield f"| {name} | {' | '.join(own)} | {THE_PAPER['cpu'] if kernels == NATIVE else ''} |"
    judged = {name: [_judged(results[mode], truth, fov) for mode in MODES] for name, truth in truths.items()}
    shares = [f"{_percent(found.beta, 1)} %" for found in judged["labels"]]
    yield f"| proposals classified | {' | '.join(shares)} | |"
    for name, evaluations in judged.items():
        cells = [
            _shares([found.ranges[ALL].classification[c].average_precision for c in sensors.CLASSES]) + " %"
            for found in evaluations
        ]
        yield f"| average precision, {name} | {' | '.join(cells)} | {THE_PAPER.get(name, '')} |"


def _run(
    frames: Sequence[Frame], fov: FieldOfView
) -> tuple[dict[str, list[FrameResult]], dict[tuple[str, str], float]]:
    """Results of each mode, and its mean CPU time a frame [ms] by kernels; all run on each frame, in random order."""
    shipped, rng = load(), np.random.default_rng(0)
    variants = list(product(MODES, (NATIVE, NUMPY_KERNELS)))
    pipelines = {(mode, kernels): _pipeline(mode, kernels, shipped, fov) for mode, kernels in variants}
    results: dict[str, list[FrameResult]] = {mode: [] for mode in MODES}
    times_ns: dict[tuple[str, str], list[int]] = {key: [] for key in pipelines}
    gc.collect()
    gc.freeze()  # as every loop does before its first frame
    for frame in frames:
        for k in rng.permutation(len(variants)).tolist():
            key = variants[k]
            pipeline, budget = pipelines[key]
            began_ns = time.thread_time_ns()
            result = pipeline.step(frame, budget)
            times_ns[key].append(time.thread_time_ns() - began_ns)
            if key[1] == NATIVE:
                results[key[0]].append(result)
    gc.unfreeze()
    return results, {key: float(np.mean(ns[FIRST:])) / 1e6 for key, ns in times_ns.items()}


def _pipeline(mode: str, kernels: str, shipped: ProfileConfig, fov: FieldOfView) -> tuple[Pipeline, Budget]:
    config = replace(shipped, segmentation=replace(shipped.segmentation, kernels=kernels))
    return assembly.pipeline(assembly.MODES[mode], config, fov), assembly.MODES[mode].budget(config)


def _judged(results: Sequence[FrameResult], truth: Truth, fov: FieldOfView) -> Evaluation:
    frames = (JudgedFrame.of_result(result, truth.frames[result.frame.index], fov) for result in results)
    return evaluation([collect(frames, truth.rules)])


def _percent(share: float | None, digits: int = 0) -> str:
    return "-" if share is None else f"{100 * share:.{digits}f}"


def _shares(values: Sequence[float | None]) -> str:
    return " / ".join(map(_percent, values))


def readme(drive: KittiDrive, further: Path | None, pandaset: Path | None) -> str:
    """Section of README.md."""
    about = "objects of 20 points or more within 60 m, car / pedestrian / cyclist [%]"
    return "\n".join(
        [
            f"At commit `{commit()}`, by `python -m tools.docs.figures`. By sensor, mode `accurate`; {about}:",
            "",
            *by_sensor(pandaset),
            "",
            f"KITTI drive {drive.number}, camera's view, car / pedestrian / cyclist:",
            "",
            *by_mode(drive, further),
        ]
    )


def paper_page(drive: KittiDrive, further: Path | None) -> str:
    """Section of docs/paper.md."""
    own: list[Drive] = [drive, *simulated_drives(SIMULATED, SIMULATED_S)]
    if further is not None:
        own.insert(1, completed([drive], further))
    about = f"{sources(PROFILES)}; made by `python -m tools.docs.figures`."
    return section(Study(chosen(NAMES), own, PROFILES).rows(1, lambda name: None), about)


def main() -> None:
    options = parser(__doc__)
    options.add_argument("kitti", type=Path, metavar="KITTI_ROOT")
    options.add_argument("--further", type=Path, metavar="FILE")
    options.add_argument("--pandaset", type=Path, metavar="FOLDER")
    options.add_argument("--only", choices=("readme", "paper"))
    args = options.parse_args()
    host.pin_to_core(None)
    drive = next((d for d in kitti_drives(args.kitti) if d.number == DRIVE and d.scans), None)
    if drive is None:
        options.error(f"{args.kitti}: no drive {DRIVE} with labels and sweeps")
    if args.only != "paper":
        _write(ROOT / "README.md", readme(drive, args.further, args.pandaset))
    if args.only != "readme":
        _write(ROOT / "docs" / "paper.md", paper_page(drive, args.further))


def _write(page: Path, made: str) -> None:
    page.write_text(replace_section(page.read_text(encoding="utf-8"), MARK, made), encoding="utf-8")


if __name__ == "__main__":
    main()
