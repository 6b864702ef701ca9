"""A run's report as text that fits a terminal; the answers first."""

from __future__ import annotations

from typing import Any

from modt.reporting.compare_text import LEGEND, conditions_text, marked, wrapped
from modt.reporting.quantity import brief


def run_text(tree: dict[str, Any]) -> str:
    """How many joules a frame and watts, where they go, what was saved, whether the prediction holds."""
    saved, parts = tree["saved"], tree["parts_J"]
    state = "" if tree["ended"] else ", still running or cut short"
    whole = sum(p.value or 0.0 for p in parts.values()) or 1.0
    lines = [
        f"{tree['stream']}: {tree['frames']} frames, mode {tree['mode']}, field of view {tree['fov']}{state}",
        "",
        f"  {marked(tree['gross_J'], 1e3)} mJ a frame, {marked(tree['power_W'])} W; "
        f"{marked(tree['net_J'], 1e3)} mJ a frame with idling taken off",
        f"  by {tree['meter']['name']} ({tree['meter']['kind']}), {tree['meter']['windows']} windows, "
        f"{tree['dropped_windows']} dropped",
        f"  {conditions_text(tree['conditions'])}",
        "",
        f"  {'where it goes':<18}{'mJ a frame':>12}{'share':>8}"
        f"{'cpu ms':>10}{'wall ms':>10}{'calls':>9}{'items':>10}",
    ]
    for name in [*parts, *(stage for stage in tree["cpu"] if stage not in parts)]:
        part, cpu = parts.get(name), tree["cpu"].get(name)
        energy = f"{marked(part, 1e3):>12}{100 * (part.value or 0.0) / whole:>7.1f}%" if part else f"{'-':>12}{'':>8}"
        times = (
            f"{brief(cpu['cpu_ms'].value):>10}{brief(cpu['wall_ms'].value):>10}"
            f"{cpu['calls'].value:>9.0f}{cpu['items'].value:>10.0f}"
            if cpu
            else ""
        )
        lines.append(f"  {name:<18}{energy}{times}")
    lines += ["", *_savings(tree, saved), ""]
    lines.append(
        f"  the ledger itself: {brief(tree['ledger']['overhead_us'].value)} us a frame, "
        f"{100 * (tree['ledger']['overhead_share'].value or 0):.2f} % of the CPU time"
    )
    if tree["marks"]:
        lines.append(f"  marked: {', '.join(tree['marks'])}")
    return "\n".join([*lines, *wrapped(tree["test"]), *wrapped(LEGEND)])


def _savings(tree: dict[str, Any], saved: dict[str, Any]) -> list[str]:
    head = (
        f"  {brief(saved['proposals'].value)} proposals a frame, beta {brief(100 * saved['beta'].value)} %, "
        f"N_go {brief(saved['N_go'].value)}, {brief(saved['views'].value)} classifications a track"
    )
    if tree["mode"] == "conventional":
        return [head, "  this is tracking-by-detection itself: nothing was saved; run the other modes, or compare"]
    return [
        head,
        *wrapped(
            f"saved {marked(saved['saved_J'], 1e3)} mJ a frame against tracking-by-detection: "
            f"gamma {marked(saved['gamma_of_this_run'])}"
        ),
        *wrapped(
            f"predicted: {marked(saved['gamma_predicted'])} in full, {marked(saved['gamma_equation_3'])} by "
            f"Equation 3, {marked(saved['gamma_short'])} by N_go alone; a = {marked(saved['a'])}"
        ),
        f"    {'from N_go to gamma':<50}{'change e':>10}{'gamma e':>10}",
        *(f"    {t['name']:<50}{t['change'].value:>+10.3f}{t['gamma'].value:>10.3f}" for t in saved["terms"]),
        *wrapped("E1 is computed here from this run's own costs; modt-profile compare measures it"),
    ]
