"""Made-up frame results, for tests of what comes after the pipeline."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from typing import Any

import numpy as np

from modt.energy.ledger import LedgerLine, StageWork
from modt.energy.meters.meter import Kind
from modt.energy.windows import EnergyWindow
from modt.geometry import transform_boxes
from modt.sinks.tracks import frame_line
from modt.types import LEFT_OUT, NONE, Frame, FrameResult, PointKind, Proposals, Tracks

STATES = ("unmatched", "tracked", "lost")


def proposals(counts: list[int], boxes: np.ndarray | None = None) -> Proposals:
    """Proposals of that many points each, taken from the frame's first points in order."""
    p = len(counts)
    offsets = np.append(0, np.cumsum(counts)).astype(np.int64)
    made = np.tile([10.0, 0, -1, 4, 2, 1.5, 0], (p, 1)) + np.arange(p)[:, None] * [0, 3.0, 0, 0, 0, 0, 0]
    box = made if boxes is None else boxes
    none, nowhere = np.zeros(p, np.int64), np.zeros((3, offsets[-1]), np.float32)
    return Proposals(np.arange(offsets[-1]), offsets, nowhere, box[:, :3].copy(), box, none)


def result(
    index: int,
    counts: list[int],
    owners: dict[int, int],
    posteriors: dict[int, list[float]] | None = None,
    *,
    n_points: int = 40,
    lost: tuple[int, ...] = (),
    classified: int = 0,
    T_world_sensor: np.ndarray | None = None,
) -> FrameResult:
    """A frame in which track owners[proposal] holds each proposal, and the lost ones hold none."""
    ids = [*owners.values(), *lost]
    tracks = Tracks.blank(len(ids))
    tracks.id[:] = ids
    tracks.proposal[:] = [*owners, *[NONE] * len(lost)]
    tracks.state[:] = [1] * len(owners) + [2] * len(lost)
    for id_, posterior in (posteriors or {}).items():
        tracks.posterior[tracks.id == id_] = posterior
        tracks.object_class[tracks.id == id_] = np.argmax(posterior)
    points = np.arange(n_points * 4, dtype=np.float32).reshape(-1, 4)
    frame = Frame(index, index / 10, points)
    T = np.eye(4) if T_world_sensor is None else T_world_sensor
    made = proposals(counts)
    tracks.whole_box[tracks.observed] = transform_boxes(T, made.box[tracks.proposal[tracks.observed]])
    return FrameResult(frame, T, made, tracks, STATES, 0, np.arange(classified))


def with_kinds(r: FrameResult) -> FrameResult:
    """The same result; its points without a proposal are of each kind in turn, ground first."""
    kind = np.resize(np.array(LEFT_OUT, np.int8), len(r.frame.points))
    kind[r.proposals.members] = PointKind.MEMBER
    return replace(r, proposals=replace(r.proposals, kind=kind))


def frame_record(r: FrameResult) -> dict[str, Any]:
    """The line of a frame in tracks.jsonl, read."""
    record: dict[str, Any] = json.loads(frame_line(r))
    return record


CAR = [0.1, 0.7, 0.1, 0.1]
TWO = [5, 4], {0: 1, 1: 2}, {1: CAR}
"""Two tracks with a proposal each, of which the first one is a car."""
PEDESTRIAN = [0.1, 0.1, 0.7, 0.1]


class Kept:
    """A sink that keeps the indices of the frames it is given."""

    def __init__(self):
        self.indices = []

    def write(self, r):
        self.indices.append(r.frame.index)

    def close(self):
        pass


def ledger_line(frame: int, cpu_ns: int = 0, **stages: StageWork) -> LedgerLine:
    """The costs of a frame."""
    return LedgerLine(frame=frame, stages=stages, wall_ns=cpu_ns, cpu_ns=cpu_ns, overhead_ns=0, idle_ns=0, marks=[])


def energy_window(energy_J: float | None, frames: int = 10, **changes: Any) -> EnergyWindow:
    """A window of a second with so many frames."""
    values: dict[str, Any] = {
        "window": 0,
        "frames": (0, frames - 1, frames),
        "wall_ns": 10**9,
        "process_ns": 0,
        "overhead_ns": 0,
        "idle_ns": 0,
        "stages": {},
        "energy_J": energy_J,
        "kind": Kind.MEASURED,
        "resolution_J": 0.0,
        "meters": [],
        "conditions": {},
        "marks": [],
    }
    return EnergyWindow(**{**values, **changes})


def status(rate_hz: float = 9.96, **power: Any) -> dict[str, Any]:
    """A status as `modt run` writes it."""
    times = {"p50": 0.1, "p99": 0.9}
    recording = {"keep": "all", "lines": 40, "lost_lines": 0, "thinned_lines": 0, "pauses": 0, "parts": 1}
    recording["fates"] = {"written": 20, "waiting": 0}
    totals = {"frames": 20, "proposals": 60, "classifications": 9, "deferred": 0}
    return {
        "schema": "modt.status/1",
        "time_s": time.time(),
        "run": "0123456789abcdef",
        "pid": 1,
        "up_s": 2.0,
        "period_s": 0.1,
        "source": "a\x1b[2Jb",
        "mode": "accurate",
        "profile": "vlp-16",
        "trust": {
            "level": "blind",
            "since_s": 1.5,
            "reasons": [{"check": "returns", "level": "blind", "since_s": 1.5, "cause": "no returns"}],
            "visibility_m": 42,
            "frames": {"good": 15, "degraded": 0, "blind": 5},
        },
        "counts": {
            **totals,
            "rate_hz": rate_hz,
            "tracks": 7,
            "visible": {"background": 3, "car": 2},
            "left_out": {"ground": 900.5, "structure": 60.2, "out_of_range": 0.0},
        },
        "loop": {
            "frames": 20,
            "missed_deadlines": 1,
            "shed_sweeps": 0,
            **dict.fromkeys(("lateness_ms", "execution_ms", "latency_ms"), times),
            "budget_ms": 80.0,
            "other_stages_ms": 12.0,
            "step": "reduced",
            "steps_entered": {"reduced": 1},
            "failures": {'frame: "x"': 2},
            "reloads": 0,
            "refused_reloads": 0,
        },
        "power": {"watts": 6.25, "kind": "estimated", "frame_J": 0.6, "stages_J": {"segmentation": 0.25}, **power},
        "sensor": {"lost_messages": 4, "silent": False, "refused_messages": {"too short": 3}},
        "odometry": {"source": "none"},
        "sinks": {"udp://x": {"written": 5, "state": "ok"}},
        "recording": {**recording, "failing": None},
        "host": {"core": None, "resident_mb": 80.0, "lacking": []},
    }
