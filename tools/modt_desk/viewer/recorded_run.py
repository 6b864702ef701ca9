"""The recorded frames of a run."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from modt import profile
from modt.config import EnergyConfig, ProfileConfig
from modt.energy.attribution import usable
from modt.energy.ledger import SCHEMA as LEDGER_SCHEMA
from modt.energy.windows import SCHEMA as ENERGY_SCHEMA
from modt.errors import MisuseError
from modt.pipeline import CLASSIFICATION
from modt.profile import from_yaml
from modt.profile.yaml_text import to_yaml
from modt.sinks.records import BROKEN, read_records, records_of
from modt.sinks.run_directory import LEDGER, RUN, TRACKS
from modt.sinks.tracks import SCHEMA
from modt.types import Float64, Int
from modt.viewer.track_rows import COLUMNS, planar
from modt_desk.energy.run_energy import run_energy
from modt_desk.evaluation.recorded_result import recorded_pose
from modt_desk.viewer.recorded_tracks import frame_rows, track_table

COUNTS: dict[str, Callable[[Any], Any]] = {
    "frame": int,
    "stamp_s": float,
    **dict.fromkeys(("proposals", "classifications", "deferred"), int),
}


@dataclass(frozen=True, slots=True)
class RecordedRun:
    """The records of a run, read.

    Attributes:
        facts: content of run.yaml.
        config: the profile that it ran with.
        frames: of each frame COUNTS, `cpu_ms` by stage, `energy_mJ` with its `kind` where a window covers it, and
            `call_mJ`, the estimated energy of each of its classifications, where energy is attributed to them.
        states: names, in the order of the column `state`.
        tracks: (R, COLUMNS) as `track_rows.COLUMNS`.
        poses: (F, 3) of the sensor in the world: x, y [m], yaw [rad].
    """

    facts: dict[str, Any]
    config: ProfileConfig
    frames: list[dict[str, Any]]
    states: list[str]
    tracks: Int
    poses: Float64

    @classmethod
    def read(cls, run: Path) -> RecordedRun:
        """The run of a directory; it may still be going on.

        Raises:
            MisuseError: not the directory of a run, no frame so far, or a broken record.
        """
        described = run / RUN
        try:
            facts = from_yaml(described.read_text(encoding="utf-8"), described)
            config = profile.parse(to_yaml(facts["profile"]), described)
            _ = facts["stream"]["path"], facts["stream"]["name"], facts["mode"]
        except (OSError, UnicodeDecodeError, TypeError, KeyError) as error:
            raise MisuseError(described, f"describes no run ({error})", "give the directory of a run") from None
        states, poses = list[str](), list[Float64]()
        with records_of(run / LEDGER):
            costs = _costs(run / LEDGER, config.energy)
        frames, rows = list[dict[str, Any]](), list[list[list[float]]]()
        for number, record in enumerate(read_records(run / TRACKS, SCHEMA)):
            try:
                counts = {name: kind(record[name]) for name, kind in COUNTS.items()}
                rows.append(frame_rows(number, record, states))
                poses.append(planar(recorded_pose(record)))
                frames.append({**counts, **costs.get(int(counts["frame"]), {})})
            except BROKEN as error:
                place = f"{run / TRACKS}:{number + 1}"
                raise MisuseError(place, f"no record of a frame ({error!r})", "run it again") from None
        if not frames:
            raise MisuseError(run / TRACKS, "no frames are recorded", "give the directory of a longer run")
        with records_of(run / TRACKS), np.errstate(over="raise", invalid="raise"):
            placed = np.stack(poses)
            return cls(facts, config, frames, states, track_table(rows, placed), placed)

    @property
    def numbers(self) -> list[int]:
        """Numbers of the frames."""
        return [recorded["frame"] for recorded in self.frames]

    @property
    def first_object(self) -> int:
        """Index of the first frame in which an object is reported; 0 where none is."""
        at, class_ = (self.tracks[:, COLUMNS.index(name)] for name in ("at", "class"))
        return int(at[class_ > 0].min(initial=len(self.frames))) % len(self.frames)

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

    @property
    def live(self) -> bool:
        """Whether its source was live and cannot be read again."""
        return self.facts["stream"]["path"] is None and bool(self.facts.get("service", False))

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
    lines = [*read_records(ledger, LEDGER_SCHEMA, ignored={ENERGY_SCHEMA})]
    windows = [*read_records(ledger, ENERGY_SCHEMA, ignored={LEDGER_SCHEMA})]
    call_W = run_energy(windows, lines, board).watts(CLASSIFICATION)
    costs: dict[int, dict[str, Any]] = {}
    for line in lines:
        costs[line["frame"]] = {"cpu_ms": {name: s["cpu_ns"] / 1e6 for name, s in line["stages"].items()}}
        calls = line["stages"].get(CLASSIFICATION, {"items": 0})
        if calls["items"] and not math.isnan(call_W):
            costs[line["frame"]]["call_mJ"] = 1e-6 * call_W * calls["cpu_ns"] / calls["items"]
    for window in windows:
        first, last, n = window["frames"]
        if n and usable(window):
            energy = {"energy_mJ": 1e3 * window["energy_J"] / n, "kind": window["kind"]}
            for frame in range(first, last + 1):
                if frame in costs:
                    costs[frame] |= energy
    return costs
