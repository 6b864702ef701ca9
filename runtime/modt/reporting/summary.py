"""The summary of a run, accumulated frame by frame in bounded memory, and its text."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import numpy as np

from modt.classes import CLASS_NAMES, OBJECTS, ObjectClass
from modt.energy.ledger import LedgerLine, StageWork
from modt.pipeline import CLASSIFICATION, SEGMENTATION, SINK, SOURCE
from modt.reporting.histogram import Histogram
from modt.types import LEFT_OUT, NONE, Bool, FrameResult, Int, Proposals, Tracks

_SCHEMA = "modt.summary/1"
COUNTED = 10
"""The points of one frame in so many are counted by kind. Of each frame it would take 2 % of the CPU time."""


class Summary:
    """Totals of a run of any length in bounded memory. Of the tracks only those alive are held."""

    def __init__(self) -> None:
        self.frames = 0
        self.proposals = 0
        self.classified = 0
        self.deferred = 0
        self._left_out = dict.fromkeys(LEFT_OUT, 0)  # points without a proposal, in the frames that are counted
        self.tracks = Tracks.blank()  # of the last frame
        self._last_proposals = Proposals.empty()
        self._ended = np.zeros((2, 2), np.int64)  # lengths of the tracks that are gone, as _lengths
        self._work: defaultdict[str, StageWork] = defaultdict(StageWork)  # sums of the ledger by stage
        self._wall_ns: defaultdict[str, Histogram] = defaultdict(Histogram)  # times of a frame by stage
        self._cpu_ns: defaultdict[str, Histogram] = defaultdict(Histogram)

    def add_result(self, result: FrameResult) -> None:
        """Add the result of a frame."""
        tracks = result.tracks
        self._ended += _lengths(self.tracks, ~np.isin(self.tracks.id, tracks.id))
        # The sweep is left out, because it would stay in memory.
        self.tracks = tracks
        self._last_proposals = result.proposals
        if self.frames % COUNTED == 0:
            for kind, count in result.left_out().items():
                self._left_out[kind] += count
        self.frames += 1
        self.proposals += len(result.proposals)
        self.classified += len(result.classified)
        self.deferred += result.n_deferred

    @property
    def left_out(self) -> dict[str, float]:
        """Mean number of points of a frame without a proposal, by kind."""
        counted = max(-(-self.frames // COUNTED), 1)
        return {kind.name.lower(): round(count / counted, 1) for kind, count in self._left_out.items()}

    def add_ledger(self, line: LedgerLine) -> None:
        """Add the ledger line of a frame."""
        for stage, work in line.stages.items():
            self._work[stage].add(work)
            self._wall_ns[stage].add(work.wall_ns)
            self._cpu_ns[stage].add(work.cpu_ns)

    def result(self) -> dict[str, Any]:
        """The summary as plain data. A ratio without a denominator is None.

        beta is classifications over those of tracking-by-detection (section V-A); N_go the number of frames in which
        a track has a proposal, averaged over tracks (section IV-C). The last class of a track counts.
        """
        lengths = (self._ended + _lengths(self.tracks)).tolist()
        all_tracks, foreground = ({"count": count, "N_go": _ratio(frames, count)} for count, frames in lengths)
        return {
            "schema": _SCHEMA,
            "frames": self.frames,
            "proposals": self.proposals,
            "proposals_per_frame": _ratio(self.proposals, self.frames),
            "classifications": self.classified,
            "classifications_by_tracking_by_detection": self.proposals,
            "deferred": self.deferred,
            "left_out": self.left_out,
            "beta": _ratio(self.classified, self.proposals),
            "around": around(self.tracks, self._last_proposals),
            "tracks": all_tracks,
            "foreground_tracks": foreground,
            "energy_counts": {
                "E_seg": self._work[SEGMENTATION].calls,
                "E_class": self._work[CLASSIFICATION].items,
            },
            "stages": {stage: self._stage(stage) for stage in self._wall_ns},
        }

    def _stage(self, stage: str) -> dict[str, Any]:
        quantiles = {"p50": 0.5, "p95": 0.95, "p99": 0.99}
        return {
            "calls": self._work[stage].calls,
            "items": self._work[stage].items,
            "wall_ms": self._wall_ns[stage].figures(1e6, **quantiles),
            "cpu_ms": self._cpu_ns[stage].figures(1e6, **quantiles),
        }


def _lengths(tracks: Tracks, rows: Bool | slice = slice(None)) -> Int:
    """(2, 2) number of tracks, and of their frames with a proposal: of all classes, then of objects."""
    hits = tracks.hits[rows]
    of_object = tracks.object_class[rows] != ObjectClass.BACKGROUND
    return np.array([[len(hits), hits.sum()], [np.count_nonzero(of_object), hits[of_object].sum()]])


def _ratio(a: float, b: float) -> float | None:
    return a / b if b else None


def around(tracks: Tracks, proposals: Proposals) -> dict[str, dict[str, Any]]:
    """Number of tracks with a proposal in a frame, and distance of their nearest return [m], by class."""
    distance_m = np.hypot(*proposals.coordinates[:2])
    nearest_m: defaultdict[str, list[float]] = defaultdict(list)
    for object_class, proposal in zip(tracks.object_class, tracks.proposal, strict=True):
        if proposal != NONE:
            begin, end = proposals.offsets[proposal : proposal + 2]
            nearest_m[CLASS_NAMES[object_class]].append(float(distance_m[begin:end].min()))
    return {name: {"count": len(each), "nearest_m": round(min(each), 2)} for name, each in nearest_m.items()}


def summary_text(summary: dict[str, Any]) -> str:
    """Objects around the robot, and the cost of detecting them: counts, time by stage, and the state of the host."""
    run = summary.get("run", {})
    title = (
        f"{run.get('stream', 'run')}: {summary['frames']} frames, mode {run.get('mode', '?')}, "
        f"field of view {run.get('fov', '?')}, profile {run.get('profile', '?')}"
    )
    lines = [title, *_around_lines(summary), *_count_lines(summary), *_left_out_lines(summary)]
    lines += _time_lines(summary["stages"])
    if "frames_per_s" in run:
        lines.append(
            f"  {run['frames_per_s']:.1f} frames/s with all of it, {run['real_time_factor']:.1f} x real time"
        )
    if "host" in summary:
        lines.append(_host_line(summary["host"]))
    return "\n".join([*lines, *_fault_lines(summary.get("faults", {})), *_read_lines(summary.get("read", {}))])


def _around_lines(summary: dict[str, Any]) -> list[str]:
    """Objects of each class around the robot, and the nearest of them."""
    lines = ["", "  Around the robot in the last frame: tracks by class, and the nearest return of each class"]
    for name in (CLASS_NAMES[c] for c in OBJECTS):
        seen = summary["around"].get(name, {"count": 0, "nearest_m": None})
        nearest = f"   nearest {seen['nearest_m']:.1f} m" if seen["count"] else ""
        lines.append(f"  {name:<16}{seen['count']:>6}{nearest}")
    return lines


def _count_lines(summary: dict[str, Any]) -> list[str]:
    """Proposals, classifications and tracks."""
    frames = summary["frames"]
    tracks = summary["tracks"]
    objects = summary["foreground_tracks"]
    return [
        "",
        "  Cost of a frame (docs/energy.md)",
        f"  {'proposals':<16}{_number(summary['proposals_per_frame']):>6}   segments that could be objects",
        f"  {'classified':<16}{_number(_ratio(summary['classifications'], frames)):>6}   by the network: beta "
        f"{_percent(summary['beta'])} of them; in mode conventional 100 %",
        f"  {'deferred':<16}{_number(_ratio(summary['deferred'], frames)):>6}   to a later frame, by the budget",
        f"  {'tracks':<16}{tracks['count']:>6}   seen in N_go = {_number(tracks['N_go'])} frames each, on average; "
        f"{objects['count']} of objects, in {_number(objects['N_go'])}",
        "",
    ]


def _left_out_lines(summary: dict[str, Any]) -> list[str]:
    """Points without a proposal by kind, if there are any."""
    means = {kind: mean for kind, mean in summary["left_out"].items() if mean}
    if not means:
        return []
    lines = [f"  {kind.replace('_', ' '):<16}{mean:>8.1f}" for kind, mean in means.items()]
    return ["  Points of a frame that belong to no segment, by kind (docs/segmentation.md)", *lines, ""]


def _time_lines(stages: dict[str, Any]) -> list[str]:
    """Times of the pipeline's stages and their sum, then those of reading and writing."""
    inside = {name: stage for name, stage in stages.items() if name not in (SOURCE, SINK)}
    outside = {name: stages[name] for name in (SOURCE, SINK) if name in stages}
    cpu_ms, wall_ms = (sum(stage[key]["mean"] for stage in inside.values()) for key in ("cpu_ms", "wall_ms"))
    return [
        f"  {'stage':<16}{'calls':>8}{'items':>9}{'cpu ms':>9}{'wall ms':>9}{'p95':>8}{'p99':>8}{'max':>8}",
        *(_stage_line(name, stage) for name, stage in inside.items()),
        f"  {'together':<16}{'':>8}{'':>9}{cpu_ms:>9.2f}{wall_ms:>9.2f}   without reading and writing",
        *(_stage_line(name, stage) for name, stage in outside.items()),
        "",
    ]


def _fault_lines(faults: dict[str, Any]) -> list[str]:
    """Faults of the source, if there are any."""
    lines = []
    if faults.get("count"):
        lines.append(f"  faulty scans: {faults['count']}, {faults['skipped']} of them skipped: {faults['first']}")
    if faults.get("frames_without_reflectance"):
        remedy = "have the driver write it, or set sensor.reflectance to none"
        lines.append(f"  without reflectance: {faults['frames_without_reflectance']} frames; {remedy}")
    return lines


def _read_lines(read: dict[str, Any]) -> list[str]:
    """Counts of what was read, and the kinds of points and poses."""
    if not read:
        return []
    joined = f", {read['joined']} of them parts of turns" if read["joined"] else ""
    frame = f"; points in {read['frame_id']}" if read["frame_id"] else ""
    deskewed = f", {read['deskewed']} deskewed" if read["deskewed"] else ""
    counts = f"{read['messages']} messages{joined}, {read['sweeps']} sweeps, {read['used']} used{deskewed}"
    return [f"  read: {counts}{frame}; poses: {read['poses']}"]


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
