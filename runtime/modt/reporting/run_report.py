"""What one run cost and saved, as a tree of figures, from its directory alone; the run may still be going on."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from modt import profile
from modt.classes import CLASS_NAMES, ObjectClass
from modt.config import ProfileConfig
from modt.energy.attribution import ByCoefficients, ByCpuTime, usable
from modt.energy.instrumentation import padded_points
from modt.energy.ledger import SCHEMA as LEDGER_SCHEMA
from modt.energy.meters.meter import Kind
from modt.energy.savings import Beside, Counts, predict
from modt.energy.windows import SCHEMA as ENERGY_SCHEMA
from modt.errors import MisuseError
from modt.pipeline import FUSION, SCHEDULING, STAGES
from modt.reporting.comparison import COUNTS
from modt.reporting.gamma import Evidence, unit_costs
from modt.reporting.quantity import figure
from modt.sinks.records import read_records
from modt.sinks.run_directory import LEDGER, RUN, SUMMARY, TRACKS
from modt.sinks.tracks import SCHEMA as FRAME_SCHEMA

SCHEMA = "modt.report/1"
BACKGROUND = CLASS_NAMES[ObjectClass.BACKGROUND]
CONVENTIONAL = "conventional"


@dataclass
class Tally:
    """What the frames of a run counted, line by line."""

    max_points: int
    batch: int
    proposals: list[int] = field(default_factory=list)
    classified: list[int] = field(default_factory=list)
    deferred: list[int] = field(default_factory=list)
    points_of_all: list[int] = field(default_factory=list)
    foreground: int = 0
    lives: Counter[int] = field(default_factory=Counter)
    classified_ids: set[int] = field(default_factory=set)

    def add(self, record: dict[str, Any]) -> None:
        """A line of tracks.jsonl."""
        seen = [track for track in record["tracks"] if track["proposal"] is not None]
        self.proposals.append(record["proposals"])
        self.classified.append(record["classifications"])
        self.deferred.append(record["deferred"])
        counts = np.array([track["points"] for track in seen], np.int64)
        self.points_of_all.append(padded_points(counts, self.max_points, self.batch))
        self.foreground += sum(track["class"] != BACKGROUND for track in seen)
        self.lives.update(track["id"] for track in seen)
        self.classified_ids.update(track["id"] for track in record["tracks"] if track["viewed"])


def run_tree(run: Path) -> dict[str, Any]:
    """Everything the directory tells.

    Raises:
        MisuseError: it is no run directory, or holds no whole frame yet.
    """
    facts = _facts(run)
    lines = list(read_records(run / LEDGER, LEDGER_SCHEMA, ignored={ENERGY_SCHEMA}))
    windows = list(read_records(run / LEDGER, ENERGY_SCHEMA, ignored={LEDGER_SCHEMA}))
    limits = facts["profile"]["classification"]
    tally = Tally(limits["max_points"], limits["batch"])
    for record in read_records(run / TRACKS, FRAME_SCHEMA):
        tally.add(record)
    frames = min(len(lines), len(tally.proposals))
    if not frames:
        raise MisuseError(run, "no whole frame is recorded", "wait for the first, or give another run")
    lines = lines[:frames]
    board = facts["profile"]["energy"]
    cpu_s = 1e-9 * np.array([[line["stages"].get(s, {}).get("cpu_ns", 0) for s in STAGES] for line in lines], float)
    energy = _energy(windows, lines, board)
    saved, predicted_s = _saved(facts["mode"], tally, lines, cpu_s, board)
    mode_budget = None if facts["mode"] == CONVENTIONAL else facts["profile"]["scheduler"]["calls_per_frame"]
    return {
        "schema": SCHEMA,
        "run": str(run),
        "stream": facts["stream"]["name"],
        "mode": facts["mode"],
        "fov": facts["fov"],
        "frames": frames,
        "ended": (run / SUMMARY).is_file(),
        "board": board["board"],
        "conditions": _conditions(windows, facts),
        "test": _circular(energy),
        **energy,
        "cpu": _times(lines),
        "ledger": _ledger(lines),
        "saved": saved,
        "marks": sorted({mark for line in [*lines, *windows] for mark in line["marks"]}),
        "series": {
            "kinds": {
                **dict.fromkeys(("cpu_ms", "classified", "deferred", "proposals", "lives"), Kind.MEASURED.value),
                **dict.fromkeys(("net_W", "predicted_cpu_ms"), Kind.ESTIMATED.value),
            },
            "net_W": board["busy_W"] - board["idle_W"],
            "cpu_ms": {s: (1e3 * cpu_s[:, k]).round(4).tolist() for k, s in enumerate(STAGES)},
            "predicted_cpu_ms": (1e3 * predicted_s).round(4).tolist(),
            "classified": tally.classified[:frames],
            "deferred": tally.deferred[:frames],
            "proposals": tally.proposals[:frames],
            "budget": mode_budget,
            "lives": sorted(tally.lives.values()),
        },
    }


def _facts(run: Path) -> dict[str, Any]:
    path = run / RUN
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        raise MisuseError(path, "missing or unreadable", "give the directory of a run of modt") from None
    facts = profile.from_yaml(text, path)
    if not isinstance(facts, dict) or facts.get("schema") != "modt.run/1":
        raise MisuseError(path, "describes no run of this version", "give the directory of a run of modt")
    known = profile.dump(ProfileConfig())
    for stage, values in known.items():
        facts["profile"][stage] = values | (facts["profile"].get(stage) or {})
    return facts


def _energy(windows: list[dict[str, Any]], lines: list[dict[str, Any]], board: dict[str, Any]) -> dict[str, Any]:
    """Joules a frame and watts, and where they go."""
    good = [w for w in usable(windows) if w["frames"][2]]
    if not good:
        good = [_modelled(line, board) for line in lines]
    frames = sum(w["frames"][2] for w in good)
    seconds = 1e-9 * sum(w["wall_ns"] for w in good)
    gross_J = sum(w["energy_J"] for w in good)
    net_J = gross_J - board["idle_W"] * seconds
    kind = Kind(good[0]["kind"])
    split = _split(board, kind)
    parts: Counter[str] = Counter()
    for window in good:
        parts.update(split.split(window))
    spread = 1.96 * float(np.sqrt(sum(w["resolution_J"] ** 2 for w in good))) / frames
    value = gross_J / frames
    return {
        "meter": {"name": good[0]["meters"][0]["name"], "kind": kind.value, "windows": len(good)},
        "gross_J": figure(value, "J", kind, (value - spread, value + spread)),
        "net_J": figure(net_J / frames, "J", kind),
        "power_W": figure(gross_J / seconds if seconds else None, "W", kind),
        "parts_J": {name: figure(part / frames, "J", Kind.ESTIMATED) for name, part in parts.items()},
        "dropped_windows": len(windows) - len(usable(windows)),
    }


def _modelled(line: dict[str, Any], board: dict[str, Any]) -> dict[str, Any]:
    """A frame as a window of the board's model, where no meter was read."""
    net_W = board["busy_W"] - board["idle_W"]
    model = f"model {board['idle_W']:g} W idle, {board['busy_W']:g} W busy"
    return line | {
        "frames": [line["frame"], line["frame"], 1],
        "process_ns": line["cpu_ns"],
        "energy_J": 1e-9 * (board["idle_W"] * line["wall_ns"] + net_W * line["cpu_ns"]),
        "kind": Kind.ESTIMATED.value,
        "resolution_J": 0.0,
        "meters": [{"name": model}],
    }


def _split(board: dict[str, Any], kind: Kind) -> ByCoefficients | ByCpuTime:
    names = ("idle_W", "seg_J", "class_J", "point_J")
    if kind is not Kind.ESTIMATED and all(board.get(name) is not None for name in names):
        return ByCoefficients({name: board[name] for name in names})
    return ByCpuTime(board["idle_W"])


def _circular(energy: dict[str, Any]) -> str:
    if energy["gross_J"].kind is Kind.ESTIMATED:
        return "Energy is watts assumed times CPU time: this tests the counting, not the physics."
    return "Energy is the meter's; its split over the stages is estimated."


def _times(lines: list[dict[str, Any]]) -> dict[str, Any]:
    stages = {stage: None for line in lines for stage in line["stages"]}
    out = {}
    for stage in stages:
        rows = [line["stages"].get(stage, {}) for line in lines]
        sums = {
            key: sum(row.get(key, 0) for row in rows) for key in ("calls", "items", "points", "cpu_ns", "wall_ns")
        }
        out[stage] = {
            "cpu_ms": figure(1e-6 * sums["cpu_ns"] / len(lines), "ms"),
            "wall_ms": figure(1e-6 * sums["wall_ns"] / len(lines), "ms"),
            **{key: figure(float(sums[key])) for key in ("calls", "items", "points")},
        }
    return out


def _ledger(lines: list[dict[str, Any]]) -> dict[str, Any]:
    overhead = sum(line["overhead_ns"] for line in lines)
    cpu = sum(line["cpu_ns"] for line in lines)
    return {
        "overhead_us": figure(1e-3 * overhead / len(lines), "us", Kind.MEASURED),
        "overhead_share": figure(overhead / cpu if cpu else None, "", Kind.MEASURED),
    }


def _saved(
    mode: str, tally: Tally, lines: list[dict[str, Any]], cpu_s: Any, board: dict[str, Any]
) -> tuple[dict[str, Any], Any]:
    """Gamma by Equation 3 and in full from this run's own counts and costs; CPU seconds of E1 for each frame."""
    frames = len(lines)
    rows = [line["stages"].get("classification", {}) for line in lines]
    counts = np.zeros((frames, len(COUNTS)), np.int64)
    counts[:, COUNTS.index("proposals")] = tally.proposals[:frames]
    counts[:, COUNTS.index("classified")] = tally.classified[:frames]
    counts[:, COUNTS.index("points")] = [row.get("points", 0) for row in rows]
    counts[:, COUNTS.index("calls")] = [row.get("calls", 0) for row in rows]
    costs = unit_costs(Evidence(counts, cpu_s))
    run = Counts(
        frames=frames,
        proposals=int(counts[:, COUNTS.index("proposals")].sum()),
        foreground=tally.foreground,
        tracks=len(tally.lives),
        classified_tracks=len(tally.classified_ids),
        classified=int(counts[:, COUNTS.index("classified")].sum()),
        refound=0,
        points=int(counts[:, COUNTS.index("points")].sum()),
        calls=int(counts[:, COUNTS.index("calls")].sum()),
    )
    all_points = np.array(tally.points_of_all[:frames])
    baseline = Counts(
        frames, run.proposals, run.foreground, run.tracks, run.tracks, run.proposals, 0, int(all_points.sum()), frames
    )
    choosing = float(cpu_s[:, [STAGES.index(SCHEDULING), STAGES.index(FUSION)]].sum(axis=1).mean())
    beside = Beside(costs.track, choosing)
    found = predict(baseline, run, costs, beside, beside)
    n = counts[:, COUNTS.index("proposals")]
    e1_s = cpu_s.sum(axis=1)
    if mode != CONVENTIONAL:
        whole = costs.class_call + costs.class_item * n + costs.class_point * all_points
        e1_s = e1_s - cpu_s[:, STAGES.index("classification")] + whole
    net_W = board["busy_W"] - board["idle_W"]
    gamma = float(e1_s.sum() / cpu_s.sum()) if cpu_s.sum() else None
    return {
        "proposals": figure(run.n),
        "N_obj": figure(run.n_obj),
        "beta": figure(run.beta),
        "N_go": figure(run.n_go, "frames"),
        "views": figure(run.classified / run.tracks if run.tracks else None),
        "E_seg": figure(net_W * costs.seg, "J", Kind.ESTIMATED),
        "E_class": figure(net_W * costs.e_class(baseline), "J", Kind.ESTIMATED),
        "a": figure(found.paper.a, "", Kind.ESTIMATED),
        "gamma_short": figure(found.paper.gamma_short, "", Kind.ESTIMATED),
        "gamma_equation_3": figure(found.paper.gamma, "", Kind.ESTIMATED),
        "gamma_predicted": figure(found.model.gamma, "", Kind.ESTIMATED),
        "gamma_of_this_run": figure(gamma, "", Kind.ESTIMATED),
        "saved_J": figure(net_W * float((e1_s - cpu_s.sum(axis=1)).mean()), "J", Kind.ESTIMATED),
        "terms": [
            {
                "name": t.name,
                "change": figure(t.change, "", Kind.ESTIMATED),
                "gamma": figure(t.gamma, "", Kind.ESTIMATED),
            }
            for t in found.explain(gamma or 1.0)
        ],
    }, e1_s


def _conditions(windows: list[dict[str, Any]], facts: dict[str, Any]) -> dict[str, Any]:
    last = windows[-1]["conditions"] if windows else {}
    return {**last, "core": facts.get("core")}
