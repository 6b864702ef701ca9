"""The summary of a run, accumulated frame by frame in bounded memory, and its text."""

from __future__ import annotations

from collections import Counter, defaultdict
from typing import Any

import numpy as np

from modt.classes import CLASS_NAMES, OBJECTS, ObjectClass
from modt.pipeline import CLASSIFICATION, SEGMENTATION, SINK, SOURCE
from modt.reporting.histogram import Histogram
from modt.types import NONE, Bool, FrameResult, Int, Proposals, Tracks

_SCHEMA = "modt.summary/1"


class Summary:
    """Totals of a run of any length in bounded memory. Of the tracks only those alive are held."""

    def __init__(self) -> None:
        self.frames = self.proposals = self.classified = self.deferred = 0
        self.tracks, self._proposals = Tracks.blank(), Proposals.empty()  # those of the last frame
        self._ended = np.zeros((2, 2), np.int64)  # lengths of the tracks that are gone
        self._work: defaultdict[str, Counter[str]] = defaultdict(Counter)  # sums of the ledger by stage
        self._times: dict[str, dict[str, Histogram]] = defaultdict(lambda: {"wall": Histogram(), "cpu": Histogram()})

    def add_result(self, result: FrameResult) -> None:
        """Add the result of a frame."""
        tracks = result.tracks
        self._ended += _lengths(self.tracks, ~np.isin(self.tracks.id, tracks.id))
        self.tracks, self._proposals = tracks, result.proposals  # without the sweep, which would stay in memory
        self.frames += 1
        self.proposals += len(result.proposals)
        self.classified += len(result.classified)
        self.deferred += result.n_deferred

    def add_ledger(self, line: dict[str, Any]) -> None:
        """Add the ledger line of a frame."""
        for stage, row in line["stages"].items():
            self._work[stage].update(row)
            for clock, histogram in self._times[stage].items():
                histogram.add(row[f"{clock}_ns"])

    def result(self) -> dict[str, Any]:
        """The summary as plain data. A ratio without a denominator is None.

        beta is classifications over those of tracking-by-detection (section V-A); N_go the number of frames in which
        a track has a proposal, averaged over tracks (section IV-C). The last class of a track counts.
        """
        work, lengths = self._work, self._ended + _lengths(self.tracks)
        all_tracks, foreground = ({"count": n, "N_go": _ratio(frames, n)} for n, frames in lengths.tolist())
        return {
            "schema": _SCHEMA,
            "frames": self.frames,
            "proposals": self.proposals,
            "proposals_per_frame": _ratio(self.proposals, self.frames),
            "classifications": self.classified,
            "classifications_by_tracking_by_detection": self.proposals,
            "deferred": self.deferred,
            "beta": _ratio(self.classified, self.proposals),
            "around": around(self.tracks, self._proposals),
            "tracks": all_tracks,
            "foreground_tracks": foreground,
            "energy_counts": {"E_seg": work[SEGMENTATION]["calls"], "E_class": work[CLASSIFICATION]["items"]},
            "stages": {stage: self._stage(stage) for stage in self._times},
        }

    def _stage(self, stage: str) -> dict[str, Any]:
        times = {
            f"{clock}_ms": histogram.figures(1e6, p50=0.5, p95=0.95, p99=0.99)
            for clock, histogram in self._times[stage].items()
        }
        return {key: self._work[stage][key] for key in ("calls", "items")} | times


def _lengths(tracks: Tracks, rows: Bool | slice = slice(None)) -> Int:
    """(2, 2) number of tracks, and of their frames with a proposal: of all classes, then of objects."""
    hits, of_object = tracks.hits[rows], tracks.object_class[rows] != ObjectClass.BACKGROUND
    return np.array([[len(hits), hits.sum()], [np.count_nonzero(of_object), hits[of_object].sum()]])


def _ratio(a: float, b: float) -> float | None:
    return a / b if b else None


def around(tracks: Tracks, proposals: Proposals) -> dict[str, dict[str, Any]]:
    """Number of tracks with a proposal in a frame, and distance of their nearest return [m], by class."""
    distance_m, found = np.hypot(*proposals.coordinates[:2]), defaultdict[str, list[float]](list)
    for kind, p in zip(tracks.object_class, tracks.proposal, strict=True):
        if p != NONE:
            begin, end = proposals.offsets[p : p + 2]
            found[CLASS_NAMES[kind]].append(float(distance_m[begin:end].min()))
    return {name: {"count": len(at), "nearest_m": round(min(at), 2)} for name, at in found.items()}


def summary_text(summary: dict[str, Any]) -> str:
    """Objects around the robot, and the cost of detecting them: counts, time by stage, and the state of the host."""
    run, stages, frames = summary.get("run", {}), dict(summary["stages"]), summary["frames"]
    tracks, objects = summary["tracks"], summary["foreground_tracks"]
    title = (
        f"{run.get('stream', 'run')}: {frames} frames, mode {run.get('mode', '?')}, "
        f"field of view {run.get('fov', '?')}, profile {run.get('profile', '?')}"
    )
    lines = [title, "", "  Around the robot in the last frame: tracks by class, and the nearest return of each class"]
    for name in (CLASS_NAMES[c] for c in OBJECTS):
        seen = summary["around"].get(name, {"count": 0, "nearest_m": None})
        nearest = f"   nearest {seen['nearest_m']:.1f} m" if seen["count"] else ""
        lines.append(f"  {name:<16}{seen['count']:>6}{nearest}")
    lines += [
        "",
        "  Cost of a frame (docs/energy.md)",
        f"  {'proposals':<16}{_number(summary['proposals_per_frame']):>6}   segments that could be objects",
        f"  {'classified':<16}{_number(_ratio(summary['classifications'], frames)):>6}   by the network: beta "
        f"{_percent(summary['beta'])} of them; in mode conventional 100 %",
        f"  {'deferred':<16}{_number(_ratio(summary['deferred'], frames)):>6}   to a later frame, by the budget",
        f"  {'tracks':<16}{tracks['count']:>6}   seen in N_go = {_number(tracks['N_go'])} frames each, on average; "
        f"{objects['count']} of objects, in {_number(objects['N_go'])}",
        "",
        f"  {'stage':<16}{'calls':>8}{'items':>9}{'cpu ms':>9}{'wall ms':>9}{'p95':>8}{'p99':>8}{'max':>8}",
    ]
    outside = {name: stages.pop(name) for name in (SOURCE, SINK) if name in stages}
    lines += [_stage_line(name, stage) for name, stage in stages.items()]
    cpu_ms, wall_ms = (sum(stage[key]["mean"] for stage in stages.values()) for key in ("cpu_ms", "wall_ms"))
    lines.append(f"  {'together':<16}{'':>8}{'':>9}{cpu_ms:>9.2f}{wall_ms:>9.2f}   without reading and writing")
    lines += [*(_stage_line(name, stage) for name, stage in outside.items()), ""]
    if "frames_per_s" in run:
        lines.append(
            f"  {run['frames_per_s']:.1f} frames/s with all of it, {run['real_time_factor']:.1f} x real time"
        )
    if "host" in summary:
        lines.append(_host_line(summary["host"]))
    faults = summary.get("faults", {})
    if faults.get("count"):
        lines.append(f"  faulty scans: {faults['count']}, {faults['skipped']} of them skipped: {faults['first']}")
    if faults.get("frames_without_reflectance"):
        remedy = "have the driver write it, or set sensor.reflectance to none"
        lines.append(f"  without reflectance: {faults['frames_without_reflectance']} frames; {remedy}")
    return "\n".join(lines)


def _stage_line(name: str, stage: dict[str, Any]) -> str:
    wall = stage["wall_ms"]
    return (
        f"  {name:<16}{stage['calls']:>8}{stage['items']:>9}{stage['cpu_ms']['mean']:>9.2f}{wall['mean']:>9.2f}"
        f"{wall['p95']:>8.2f}{wall['p99']:>8.2f}{wall['max']:>8.2f}"
    )


def _host_line(host: dict[str, Any]) -> str:
    core = "any core" if host["core"] is None else f"core {host['core']}"
    kept = "verified: one thread did the work" if host["one_core_verified"] else "NOT kept to one core"
    others = f"{host['threads']} threads exist, all but the main one used {host['other_threads_cpu_s']:.2f} s of CPU"
    return f"  {core} ({kept}; {others}), peak memory {host['peak_rss_mb']:.0f} MB"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.1f} %"
