"""The summary of a run, accumulated frame by frame in bounded memory, and its text."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable
from typing import Any

from modt.classes import ObjectClass
from modt.pipeline import CLASSIFICATION, SEGMENTATION, SOURCE
from modt.reporting.histogram import MAX_EXACT, Histogram
from modt.types import NONE, FrameResult

_SCHEMA = "modt.summary/1"


class TrackLives:
    """Number of tracks and of the frames in which they had a proposal; holds only the tracks alive."""

    def __init__(self) -> None:
        self._alive: dict[int, tuple[int, bool]] = {}
        self._ended = {True: [0, 0], False: [0, 0]}  # foreground: tracks, frames with a proposal

    def __len__(self) -> int:
        """Tracks held."""
        return len(self._alive)

    def add(self, tracks: Iterable[tuple[int, bool, bool]]) -> None:
        """Add the tracks of one frame: id, whether it has a proposal, whether it is foreground."""
        present: dict[int, tuple[int, bool]] = {}
        for id_, visible, foreground in tracks:
            seen, _ = self._alive.pop(id_, (0, False))
            present[id_] = (seen + visible, foreground)
        for seen, foreground in self._alive.values():
            self._ended[foreground][0] += 1
            self._ended[foreground][1] += seen
        self._alive = present

    def totals(self, *, foreground_only: bool) -> tuple[int, int]:
        """Number of tracks and of their frames with a proposal; the class of a track is its last."""
        groups = (True,) if foreground_only else (True, False)
        alive = [seen for seen, foreground in self._alive.values() if foreground in groups]
        tracks, frames = (sum(self._ended[g][k] for g in groups) for k in (0, 1))
        return tracks + len(alive), frames + sum(alive)


class Summary:
    """Totals of a run of any length; memory is bounded (`Histogram`, `TrackLives`).

    Args:
        max_exact: distinct times of which quantiles are exact; 0 takes little memory from the first frame on.
    """

    def __init__(self, max_exact: int = MAX_EXACT) -> None:
        self.frames = self.proposals = self.classified = self.deferred = 0
        self.lives = TrackLives()
        self._calls: Counter[str] = Counter()
        self._items: Counter[str] = Counter()
        self._times: dict[str, dict[str, Histogram]] = defaultdict(
            lambda: {"wall": Histogram(max_exact), "cpu": Histogram(max_exact)}
        )

    def add_result(self, result: FrameResult) -> None:
        """Add the result of a frame."""
        tracks = result.tracks
        self.frames += 1
        self.proposals += len(result.proposals)
        self.classified += len(result.classified)
        self.deferred += result.n_deferred
        seen, foreground = tracks.proposal != NONE, tracks.object_class != ObjectClass.BACKGROUND
        self.lives.add(zip(tracks.id.tolist(), seen.tolist(), foreground.tolist(), strict=True))

    def add_ledger(self, line: dict[str, Any]) -> None:
        """Add the ledger line of a frame."""
        for stage, row in line["stages"].items():
            self._calls[stage] += row["calls"]
            self._items[stage] += row["items"]
            for clock, histogram in self._times[stage].items():
                histogram.add(row[f"{clock}_ns"])

    def result(self) -> dict[str, Any]:
        """The summary as plain data; a ratio without a denominator is None.

        beta is classifications over those of tracking-by-detection (section V-A); N_go the number of frames in which
        a track has a proposal, averaged over tracks (section IV-C).
        """
        return {
            "schema": _SCHEMA,
            "frames": self.frames,
            "proposals": self.proposals,
            "proposals_per_frame": _ratio(self.proposals, self.frames),
            "classifications": self.classified,
            "classifications_by_tracking_by_detection": self.proposals,
            "deferred": self.deferred,
            "beta": _ratio(self.classified, self.proposals),
            "tracks": self._life(foreground_only=False),
            "foreground_tracks": self._life(foreground_only=True),
            "energy_counts": {"E_seg": self._calls[SEGMENTATION], "E_class": self._items[CLASSIFICATION]},
            "stages": {stage: self._stage(stage) for stage in self._times},
        }

    def _life(self, *, foreground_only: bool) -> dict[str, Any]:
        tracks, frames = self.lives.totals(foreground_only=foreground_only)
        return {"count": tracks, "N_go": _ratio(frames, tracks)}

    def _stage(self, stage: str) -> dict[str, Any]:
        times = {
            f"{clock}_ms": histogram.figures(1e6, p50=0.5, p95=0.95, p99=0.99)
            for clock, histogram in self._times[stage].items()
        }
        return {"calls": self._calls[stage], "items": self._items[stage], **times}


def _ratio(a: float, b: float) -> float | None:
    return a / b if b else None


def summary_text(summary: dict[str, Any]) -> str:
    """Counts, time by stage, and the state of the host."""
    run = summary.get("run", {})
    tracks, objects = summary["tracks"], summary["foreground_tracks"]
    lines = [
        f"{run.get('stream', 'run')}: {summary['frames']} frames, mode {run.get('mode', '?')}, "
        f"field of view {run.get('fov', '?')}, profile {run.get('profile', '?')}",
        "",
        f"  proposals          {summary['proposals']:>9}   {_number(summary['proposals_per_frame'])} a frame",
        f"  tracks             {tracks['count']:>9}   N_go {_number(tracks['N_go'])} frames",
        f"    of objects       {objects['count']:>9}   N_go {_number(objects['N_go'])} frames",
        f"  classifications    {summary['classifications']:>9}   one per proposal and frame would be "
        f"{summary['classifications_by_tracking_by_detection']} (beta {_percent(summary['beta'])})",
        f"  deferred           {summary['deferred']:>9}   to a later frame, by the budget of calls a frame",
        "",
        f"  {'stage':<16}{'calls':>8}{'items':>9}{'cpu ms':>9}{'wall ms':>9}{'p95':>8}{'p99':>8}{'max':>8}   a frame",
    ]
    for name, stage in summary["stages"].items():
        wall, cpu = stage["wall_ms"], stage["cpu_ms"]
        lines.append(
            f"  {name:<16}{stage['calls']:>8}{stage['items']:>9}{cpu['mean']:>9.2f}{wall['mean']:>9.2f}"
            f"{wall['p95']:>8.2f}{wall['p99']:>8.2f}{wall['max']:>8.2f}"
        )
    total_cpu, total_wall = (sum(s[key]["mean"] for s in summary["stages"].values()) for key in ("cpu_ms", "wall_ms"))
    lines += [f"  {'all':<16}{'':>8}{'':>9}{total_cpu:>9.2f}{total_wall:>9.2f}", ""]
    if "frames_per_s" in run:
        source_ms = summary["stages"].get(SOURCE, {}).get("wall_ms", {}).get("mean", 0.0)
        lines.append(
            f"  {run['frames_per_s']:.1f} frames/s, {run['real_time_factor']:.1f} x real time; "
            f"{total_wall - source_ms:.1f} ms a frame without the source"
        )
    if run.get("missed_deadlines"):
        lines.append(
            f"  missed {run['missed_deadlines']} deadlines at {run['rate_hz']:g} frames/s, the latest frame began "
            f"{run['max_lateness_ms']:.0f} ms late"
        )
    if "host" in summary:
        lines.append(_host_line(summary["host"]))
    faults = summary.get("faults", {})
    if faults.get("count"):
        lines.append(f"  faulty scans: {faults['count']}, {faults['skipped']} of them skipped: {faults['first']}")
    lacking = faults.get("frames_without_reflectance")
    if lacking:
        remedy = "have the driver write it, or set sensor.reflectance to none"
        lines.append(f"  without reflectance: {lacking} frames; {remedy}")
    return "\n".join(lines)


def _host_line(host: dict[str, Any]) -> str:
    core = "any core" if host["core"] is None else f"core {host['core']}"
    kept = "verified: one thread did the work" if host["one_core_verified"] else "NOT kept to one core"
    others = f"{host['threads']} threads exist, all but the main one used {host['other_threads_cpu_s']:.2f} s of CPU"
    return f"  {core} ({kept}; {others}), peak memory {host['peak_rss_mb']:.0f} MB"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.1f} %"
