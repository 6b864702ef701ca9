"""The report of one run as a tree of quantities, from its directory alone; the run may still be going on."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from modt import profile
from modt.classes import CLASS_NAMES, ObjectClass
from modt.config import ProfileConfig
from modt.energy.attribution import split_by_coefficients, split_by_cpu_time, usable_windows
from modt.energy.instrumentation import padded_points
from modt.energy.ledger import SCHEMA as LEDGER_SCHEMA
from modt.energy.meters.meter import Kind
from modt.energy.meters.model import model_name
from modt.energy.savings import predict
from modt.energy.windows import SCHEMA as ENERGY_SCHEMA
from modt.errors import MisuseError
from modt.pipeline import CLASSIFICATION, STAGES
from modt.reporting.comparison import COUNTS, cpu_seconds, total
from modt.reporting.gamma import CLASS, RunCosts, other_costs, prediction_tree, unit_costs
from modt.reporting.quantity import estimate, quantity
from modt.sinks.records import read_records
from modt.sinks.run_directory import LEDGER, RUN, SUMMARY, TRACKS
from modt.sinks.tracks import SCHEMA as FRAME_SCHEMA
from modt.types import Float64

SCHEMA = "modt.report/1"
_BACKGROUND = CLASS_NAMES[ObjectClass.BACKGROUND]
_CONVENTIONAL = "conventional"


@dataclass
class FrameCounts:
    """Counts over the lines of tracks.jsonl.

    A row a frame: proposals, classifications, deferred, and points if all proposals were classified.
    """

    max_points: int  # this and the batch as in the classifier's configuration
    batch: int
    rows: list[tuple[int, int, int, int]] = field(default_factory=list)
    foreground: int = 0  # proposals of a track whose class is an object's
    lives: Counter[int] = field(default_factory=Counter)  # frames with a proposal, by track id
    classified_ids: set[int] = field(default_factory=set)  # of the tracks classified at least once

    def add(self, record: dict[str, Any]) -> None:
        """Add a line of tracks.jsonl."""
        seen = [track for track in record["tracks"] if track["proposal"] is not None]
        sizes = np.array([track["points"] for track in seen], np.int64)
        points = padded_points(sizes, self.max_points, self.batch)
        self.rows.append((record["proposals"], record["classifications"], record["deferred"], points))
        self.foreground += sum(track["class"] != _BACKGROUND for track in seen)
        self.lives.update(track["id"] for track in seen)
        self.classified_ids.update(track["id"] for track in record["tracks"] if track["viewed"])


def run_tree(run: Path) -> dict[str, Any]:
    """Report of a run directory.

    Raises:
        MisuseError: not a run directory, or without a complete frame so far.
    """
    facts = _facts(run)
    lines = list(read_records(run / LEDGER, LEDGER_SCHEMA, ignored={ENERGY_SCHEMA}))
    windows = list(read_records(run / LEDGER, ENERGY_SCHEMA, ignored={LEDGER_SCHEMA}))
    limits, board, mode = facts["profile"]["classification"], facts["profile"]["energy"], facts["mode"]
    counted = FrameCounts(limits["max_points"], limits["batch"])
    for record in read_records(run / TRACKS, FRAME_SCHEMA):
        counted.add(record)
    frames = min(len(lines), len(counted.rows))
    if not frames:
        raise MisuseError(run, "no whole frame is recorded", "wait for the first, or give another run")
    lines = lines[:frames]
    proposals, classified, deferred, _ = np.array(counted.rows[:frames]).T.tolist()
    cpu_s = cpu_seconds(lines)
    saved, predicted_s = _saved(mode, counted, lines, cpu_s, board)
    energy = _energy(windows, lines, board)
    return {
        "schema": SCHEMA,
        "run": str(run),
        "stream": facts["stream"]["name"],
        "mode": mode,
        "fov": facts["fov"],
        "frames": frames,
        "ended": (run / SUMMARY).is_file(),
        "board": board["board"],
        "conditions": {**(windows[-1]["conditions"] if windows else {}), "core": facts.get("core")},
        "test": (
            "Energy is assumed power times CPU time: this tests the counting, not the physics."
            if energy["gross_J"].kind is Kind.ESTIMATED
            else "Energy is the meter's; its split over the stages is estimated."
        ),
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
            "classified": classified,
            "deferred": deferred,
            "proposals": proposals,
            "budget": None if mode == _CONVENTIONAL else facts["profile"]["scheduler"]["calls_per_frame"],
            "lives": sorted(counted.lives.values()),
        },
    }


def _facts(run: Path) -> dict[str, Any]:
    """Content of run.yaml, with the default of every key that its profile lacks."""
    path = run / RUN
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        raise MisuseError(path, "missing or unreadable", "give the directory of a run of modt") from None
    facts = profile.from_yaml(text, path)
    if not isinstance(facts, dict) or facts.get("schema") != "modt.run/1":
        raise MisuseError(path, "describes no run of this version", "give the directory of a run of modt")
    for stage, values in profile.dump(ProfileConfig()).items():
        facts["profile"][stage] = values | (facts["profile"].get(stage) or {})
    return facts


def _energy(windows: list[dict[str, Any]], lines: list[dict[str, Any]], board: dict[str, Any]) -> dict[str, Any]:
    """Energy a frame [J] and power [W], and their distribution."""
    usable = usable_windows(windows)
    good = [w for w in usable if w["frames"][2]] or [_modelled(line, board) for line in lines]
    frames = sum(w["frames"][2] for w in good)
    seconds = 1e-9 * sum(w["wall_ns"] for w in good)
    gross_J = sum(w["energy_J"] for w in good)
    kind = Kind(good[0]["kind"])
    coefficients = {name: board[name] for name in ("idle_W", "seg_J", "class_J", "point_J")}
    calibrated = kind is not Kind.ESTIMATED and None not in coefficients.values()
    parts_J: Counter[str] = Counter()
    for w in good:
        parts_J.update(
            split_by_coefficients(w, coefficients) if calibrated else split_by_cpu_time(w, board["idle_W"])
        )
    error_J = 1.96 * float(np.sqrt(sum(w["resolution_J"] ** 2 for w in good)))
    bounds = ((gross_J - error_J) / frames, (gross_J + error_J) / frames)
    return {
        "meter": {"name": good[0]["meters"][0]["name"], "kind": kind.value, "windows": len(good)},
        "gross_J": quantity(gross_J / frames, "J", kind, bounds),
        "net_J": quantity((gross_J - board["idle_W"] * seconds) / frames, "J", kind),
        "power_W": quantity(gross_J / seconds if seconds else None, "W", kind),
        "parts_J": {name: estimate(part_J / frames, "J") for name, part_J in parts_J.items()},
        "dropped_windows": len(windows) - len(usable),
    }


def _modelled(line: dict[str, Any], board: dict[str, Any]) -> dict[str, Any]:
    """A frame as a window of the board's model, where no meter was read."""
    net_W = board["busy_W"] - board["idle_W"]
    return line | {
        "frames": [line["frame"], line["frame"], 1],
        "process_ns": line["cpu_ns"],
        "energy_J": 1e-9 * (board["idle_W"] * line["wall_ns"] + net_W * line["cpu_ns"]),
        "kind": Kind.ESTIMATED.value,
        "resolution_J": 0.0,
        "meters": [{"name": model_name(board["idle_W"], board["busy_W"])}],
    }


def _times(lines: list[dict[str, Any]]) -> dict[str, Any]:
    sums: defaultdict[str, Counter[str]] = defaultdict(Counter)
    for line in lines:
        for stage, row in line["stages"].items():
            sums[stage].update(row)
    return {
        stage: {
            "cpu_ms": quantity(1e-6 * row["cpu_ns"] / len(lines), "ms"),
            "wall_ms": quantity(1e-6 * row["wall_ns"] / len(lines), "ms"),
            **{key: quantity(row[key]) for key in ("calls", "items", "points")},
        }
        for stage, row in sums.items()
    }


def _ledger(lines: list[dict[str, Any]]) -> dict[str, Any]:
    overhead_ns, cpu_ns = (sum(line[key] for line in lines) for key in ("overhead_ns", "cpu_ns"))
    return {
        "overhead_us": quantity(1e-3 * overhead_ns / len(lines), "us"),
        "overhead_share": quantity(overhead_ns / cpu_ns if cpu_ns else None),
    }


def _saved(
    mode: str, counted: FrameCounts, lines: list[dict[str, Any]], cpu_s: Float64, board: dict[str, Any]
) -> tuple[dict[str, Any], Float64]:
    """Gamma by Equation 3 and in full from this run's own counts and costs; (frames,) CPU seconds of E1."""
    frames = len(lines)
    rows = [line["stages"].get(CLASSIFICATION, {}) for line in lines]
    n, classified, _, all_points = np.array(counted.rows[:frames]).T
    counts = np.zeros((frames, len(COUNTS)), np.int64)
    counts[:, COUNTS.index("proposals")] = n
    counts[:, COUNTS.index("classified")] = classified
    for name in ("points", "calls"):
        counts[:, COUNTS.index(name)] = [row.get(name, 0) for row in rows]
    costs_of_run = RunCosts(counts, cpu_s)
    costs, other = unit_costs(costs_of_run), other_costs(costs_of_run)
    run = replace(
        total(counts),
        foreground=counted.foreground,
        tracks=len(counted.lives),
        classified_tracks=len(counted.classified_ids),
    )
    points = int(all_points.sum())
    baseline = replace(run, classified_tracks=run.tracks, classified=run.proposals, points=points, calls=frames)
    found = predict(baseline, run, costs, other, other)
    run_s = e1_s = cpu_s.sum(axis=1)
    if mode != _CONVENTIONAL:
        all_s = costs.class_call + costs.class_item * n + costs.class_point * all_points
        e1_s = run_s - cpu_s[:, CLASS] + all_s
    net_W = board["busy_W"] - board["idle_W"]
    gamma = float(e1_s.sum() / run_s.sum()) if run_s.sum() else None
    return {
        "proposals": quantity(run.n),
        "N_obj": quantity(run.n_obj),
        "beta": quantity(run.beta),
        "N_go": quantity(run.n_go, "frames"),
        "views": quantity(run.classified / run.tracks if run.tracks else None),
        "E_seg": estimate(net_W * costs.seg, "J"),
        "E_class": estimate(net_W * costs.e_class(baseline), "J"),
        **prediction_tree(found, gamma),
        "gamma_of_this_run": estimate(gamma),
        "saved_J": estimate(net_W * float((e1_s - run_s).mean()), "J"),
    }, e1_s
