"""The recorded frames of a run, its tracks as one table of `modt.viewer.track_rows`, and their extent."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from modt import profile
from modt.config import EnergyConfig, ProfileConfig
from modt.energy.attribution import usable
from modt.energy.ledger import PIPELINE, StageWork
from modt.errors import MisuseError
from modt.pipeline import CLASSIFICATION
from modt.profile import to_yaml
from modt.sinks.records import BROKEN, records_of
from modt.sinks.run_directory import LEDGER, RUN, TRACKS
from modt.types import NONE, Float64, FrameResult, Int
from modt.viewer.html_page import trust_text
from modt.viewer.theme import REACH_M
from modt.viewer.track_rows import COLUMNS, SCALE, planar, result_rows, scaled
from modt_evaluation.recorded_result import recorded_result
from modt_evaluation.run_record import RunRecord, broken
from modt_profiling.energy.run_energy import run_energy
from modt_profiling.reporting.records import read_ledger, read_windows


@dataclass(frozen=True)
class RecordedRun:
    """The records of a run, read.

    Attributes:
        record: its directory.
        config: the profile that it ran with.
        frames: number, stamp [s] and counts of each frame; `cpu_ms` by stage; `energy_mJ` of the process and
            `pipeline_mJ`, with their `kind`, where a window covers it; `call_mJ`, the estimated energy of each of its
            classifications, where it is attributed.
        states: names, in the order of the column `state`.
        tracks: (R, COLUMNS) as `track_rows.COLUMNS`.
        poses: (F, 3) poses of the sensor in the world: x, y [m], yaw [rad].
    """

    record: RunRecord
    config: ProfileConfig
    frames: list[dict[str, Any]]
    states: list[str]
    tracks: Int
    poses: Float64

    @classmethod
    def read(cls, run: Path) -> RecordedRun:
        """The run of a directory, which may be in progress.

        Raises:
            MisuseError: not the directory of a run, no frame so far, or a broken record.
        """
        opened = RunRecord.open(run)
        config = profile.parse(to_yaml(opened.facts["profile"]), run / RUN)
        with records_of(run / LEDGER):
            costs = _costs(run / LEDGER, config.energy)
        frames = list[dict[str, Any]]()
        rows = list[Float64]()
        states = list[str]()
        poses = list[Float64]()
        boxes: dict[int, Float64] = {}
        for number, (place, record) in enumerate(opened.records()):
            try:
                result = recorded_result(record)
                classifications = int(record["classifications"])
                rows.append(frame_rows(number, result, states, boxes))
                poses.append(planar(result.T_world_sensor))
                counts = {
                    "frame": result.frame.index,
                    "stamp_s": result.frame.stamp_s,
                    "proposals": len(result.proposals),
                    "classifications": classifications,
                    "deferred": result.n_deferred,
                    "trust": trust_text(record["trust"]),
                }
                frames.append(counts | costs.get(result.frame.index, {}))
            except BROKEN as error:
                raise broken(place, error) from None
        with records_of(run / TRACKS), np.errstate(over="raise", invalid="raise"):
            return cls(opened, config, frames, states, track_table(rows), np.stack(poses))

    @property
    def facts(self) -> dict[str, Any]:
        """Content of run.yaml."""
        return self.record.facts

    @property
    def numbers(self) -> list[int]:
        """Numbers of the frames."""
        return [recorded["frame"] for recorded in self.frames]

    @property
    def first_object(self) -> int:
        """Index of the first frame in which an object is reported; 0 where none is."""
        at, class_ = (self.tracks[:, COLUMNS.index(name)] for name in ("at", "class"))
        none = len(self.frames)
        return int(at[class_ > 0].min(initial=none)) % none

    @property
    def budget(self) -> str:
        """Budget of a frame for classification, in words."""
        scheduler = self.config.scheduler
        limits = {
            "calls": scheduler.calls_per_frame,
            "ms": scheduler.cpu_ms_per_frame,
            "mJ": scheduler.energy_mJ_per_frame,
        }
        found = [f"{limit:g} {unit}" for unit, limit in limits.items() if limit is not None]
        return ", ".join(found) if found and self.facts["mode"] != "conventional" else "none"

    @property
    def sensor(self) -> str:
        """Name of its profile."""
        return " + ".join(self.facts.get("profiles", ()))

    def position(self, frame: int) -> int:
        """Index of a frame, by its number.

        Raises:
            MisuseError: it is not recorded.
        """
        numbers = self.numbers
        if frame not in numbers:
            remedy = f"give one from {numbers[0]} to {numbers[-1]}"
            raise MisuseError(f"--frame {frame}", "is not recorded", remedy)
        return numbers.index(frame)


def _costs(ledger: Path, board: EnergyConfig) -> dict[int, dict[str, Any]]:
    """CPU time and energy by number of frame."""
    lines = [*read_ledger(ledger)]
    windows = [*read_windows(ledger)]
    sums = run_energy(windows, lines, board)
    call_W = sums.watts(CLASSIFICATION)
    watts = sums.stage_watts(PIPELINE)
    costs: dict[int, dict[str, Any]] = {}
    for line in lines:
        costs[line.frame] = {"cpu_ms": {name: work.cpu_ns / 1e6 for name, work in line.stages.items()}}
        calls = line.stages.get(CLASSIFICATION, StageWork())
        if calls.items and not math.isnan(call_W):
            costs[line.frame]["call_mJ"] = 1e-6 * call_W * calls.cpu_ns / calls.items
    for window in windows:
        first, last, _ = window.frames
        if first is not None and last is not None and window.frame_J is not None and usable(window):
            energy = {"energy_mJ": 1e3 * window.frame_J, "kind": window.kind}
            for frame in range(first, last + 1):
                if frame in costs:
                    costs[frame] |= energy
                    costs[frame]["pipeline_mJ"] = sum(
                        W * costs[frame]["cpu_ms"].get(name, 0.0) for name, W in watts.items()
                    )
    return costs


def frame_rows(at: int, result: FrameResult, states: list[str], boxes: dict[int, Float64]) -> Float64:
    """(M, COLUMNS) rows of a recorded result.

    Args:
        at: index of the frame.
        result: recorded result, whose lost tracks get their last boxes.
        states: names of the states so far; those of the result are added.
        boxes: last box of each track in the world so far, by its id; those of the result are added.
    """
    states += [name for name in result.state_names if name not in states]
    number = np.array([states.index(name) for name in result.state_names], np.int64)
    tracks = result.tracks
    for id_, lost, box in zip(tracks.id.tolist(), (tracks.proposal == NONE).tolist(), tracks.whole_box, strict=True):
        box[:] = boxes.get(id_, box) if lost else box
        boxes[id_] = box
    rows = result_rows(result)
    rows[:, COLUMNS.index("at")] = at
    rows[:, COLUMNS.index("state")] = number[tracks.state]
    return rows


def track_table(frames: Iterable[Float64]) -> Int:
    """(R, COLUMNS) table of the rows of the frames."""
    rows = np.concatenate([np.zeros((0, len(COLUMNS))), *frames])
    return scaled(rows[np.lexsort((rows[:, 1], rows[:, 0]))])


_SIDE_M = 32.0
"""Half the height of a picture whose half width is REACH_M."""
RINGS_M = {6.0: 2, 10.0: 5, 15.0: 5, 20.0: 10, 30.0: 10, REACH_M: 20}
"""Ranges that a picture may reach, and the distance of the rings in it."""
_NEARLY = 0.95
"""Share of the tracked boxes that must be visible."""


def reach_m(tracks: Int) -> float:
    """Half the width of a picture that shows nearly all of (R, COLUMNS) rows of tracks; REACH_M at most."""
    seen = tracks[tracks[:, COLUMNS.index("seen")] > 0]
    if not len(seen):
        return REACH_M
    x, y = (np.abs(seen[:, COLUMNS.index(name)]) / SCALE[name] for name in ("x", "y"))
    needed = np.quantile(np.maximum(x, y * REACH_M / _SIDE_M), _NEARLY)
    return next((reach for reach in RINGS_M if reach >= needed), REACH_M)
