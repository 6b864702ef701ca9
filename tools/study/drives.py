"""Drives that studies are made on: simulated ones, and labelled recordings."""

from __future__ import annotations

from argparse import ArgumentParser
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

from modt.app import assembly
from modt.cli.options import frames as number_range
from modt.config import ProfileConfig
from modt.geometry import FieldOfView
from modt.profile import DEFAULT, load
from modt.sources.recognise import open_stream
from modt.types import Frame, FrameResult
from modt_evaluation.engine import Engine
from modt_evaluation.evaluation import DriveRows, collect
from modt_evaluation.experiments.drives import simulated_truth
from modt_evaluation.frame import JudgedFrame
from modt_evaluation.further_objects import with_further
from modt_evaluation.rules import CUBOID_RULES, Rules
from modt_evaluation.truth import KITTI_TYPES, FrameTruth
from modt_evaluation.truth_files import open_truth
from modt_simulation.sensors import SENSORS
from modt_simulation.synthetic_stream import SCENES, SyntheticStream


@dataclass(frozen=True)
class Drive:
    """Frames with their labels, and the profile of their sensor."""

    name: str
    profile: ProfileConfig
    frames: Sequence[tuple[Frame, FrameTruth]]
    rules: Rules = CUBOID_RULES
    fov: FieldOfView = field(default_factory=FieldOfView)


def simulated(scene: str, sensor: str, seconds: float, seed: int, **conditions: Any) -> Drive:
    """A simulated drive, labelled all round; `conditions` are those of SyntheticStream."""
    stream = SyntheticStream(scene, sensor, seconds, seed, **conditions)
    frames = [(frame, simulated_truth(truth)) for frame, truth in stream.sweeps()]
    return Drive(stream.info.name, load(sensor), frames)


def labelled(path: Path, profile: str = DEFAULT, *, further: Path | None = None) -> Drive:
    """A labelled recording, in the camera's view if it has one.

    Args:
        path: its folder, with the scans in `scans/` or beside the labels.
        profile: profile of its sensor.
        further: table of objects that the labels leave out (docs/evaluation.md).
    """
    scans = path / "scans"
    stream = open_stream(scans if scans.is_dir() else path)
    truth = open_truth(path)
    if further is not None:
        truth = with_further(truth, further, KITTI_TYPES)
    fov = FieldOfView() if stream.info.camera is None else FieldOfView.of_camera(stream.info.camera)
    frames = [(frame, truth.frames[frame.index]) for frame in stream if frame.index in truth.frames]
    return Drive(path.name, load(profile), frames, truth.rules, fov)


def add_options(options: ArgumentParser, scenes: Sequence[str], seeds: tuple[int, int]) -> None:
    """Add the options of simulated drives: sensors, scenes, seeds, seconds, and the mode that runs on them."""
    options.add_argument("--sensors", nargs="+", choices=SENSORS, default=["vlp-16", "os1-64", "mid-360"])
    options.add_argument("--scenes", nargs="+", choices=SCENES, default=scenes)
    options.add_argument("--seeds", type=number_range, default=seeds, metavar="A:B")
    options.add_argument("--seconds", type=float, default=4.0)
    options.add_argument("--mode", choices=assembly.MODES, default="accurate")


@dataclass(frozen=True)
class SimulatedRun:
    """A simulated drive and the modes to run on it, as a task of an engine.

    Attributes:
        scene, sensor, seconds, seed: as of SyntheticStream.
        modes: modes of the method.
        number: number of the drive among those that are pooled.
        conditions: further arguments of SyntheticStream.
    """

    scene: str
    sensor: str
    seconds: float
    seed: int
    modes: tuple[str, ...]
    number: int
    conditions: Mapping[str, Any]


def judged_in_order(
    engine: Engine,
    scenes: Sequence[str],
    sensor: str,
    seconds: float,
    seeds: Sequence[int],
    modes: tuple[str, ...],
    conditions: Mapping[str, Any],
) -> list[list[DriveRows]]:
    """Drives of every seed and scene, each judged in each of the modes; other arguments as of SimulatedRun."""
    runs = [
        SimulatedRun(scene, sensor, seconds, seed, modes, number, conditions)
        for number, (seed, scene) in enumerate(product(seeds, scenes))
    ]
    judged_of = {run.number: rows for run, rows in engine.results(_judged_in_modes, runs)}
    return [judged_of[run.number] for run in runs]


def _judged_in_modes(run: SimulatedRun) -> list[DriveRows]:
    """The drive judged in each of the modes."""
    drive = simulated(run.scene, run.sensor, run.seconds, run.seed, **run.conditions)
    return [judged(drive, mode, run.number) for mode in run.modes]


Step = Callable[[Frame], FrameResult]
"""Processes a frame."""


def steps_of(mode_name: str, profile: ProfileConfig, fov: FieldOfView | None = None) -> Step:
    """A new pipeline of a mode with its budget, over the full circle by default."""
    mode = assembly.MODES[mode_name]
    pipeline = assembly.pipeline(mode, profile, fov or FieldOfView())
    return partial(pipeline.step, budget=mode.budget(profile))


def judged(drive: Drive, mode_name: str, number: int = 0) -> DriveRows:
    """Run a drive in a mode and judge it. Drives that are pooled need different numbers."""
    step = steps_of(mode_name, drive.profile, drive.fov)
    frames = (JudgedFrame.of_result(step(frame), truth, drive.fov) for frame, truth in drive.frames)
    return collect(frames, drive.rules, number)
