"""The summary of a run as text."""

from __future__ import annotations

from typing import Any

from modt.pipeline import SOURCE


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
