"""The report of a run as text for a terminal, results first."""

from __future__ import annotations

from typing import Any

from modt.reporting.compare_text import conditions_text, terms_text, wrapped
from modt.reporting.quantity import LEGEND, format_number


def run_text(tree: dict[str, Any]) -> str:
    """Energy a frame and power, their distribution, the energy saved, and the prediction."""
    parts, meter, ledger = tree["parts_J"], tree["meter"], tree["ledger"]
    state = "" if tree["ended"] else ", still running or cut short"
    whole = sum(p.value or 0.0 for p in parts.values()) or 1.0
    lines = [
        f"{tree['stream']}: {tree['frames']} frames, mode {tree['mode']}, field of view {tree['fov']}{state}",
        "",
        f"  {tree['gross_J'].marked(1e3)} mJ a frame, {tree['power_W'].marked()} W; "
        f"{tree['net_J'].marked(1e3)} mJ a frame without idling",
        f"  by {meter['name']} ({meter['kind']}), {meter['windows']} windows, {tree['dropped_windows']} dropped",
        f"  {conditions_text(tree['conditions'])}",
        "",
        f"  {'stage':<18}{'mJ a frame':>12}{'share':>8}{'cpu ms':>10}{'wall ms':>10}{'calls':>9}{'items':>10}",
    ]
    for name in dict.fromkeys([*parts, *tree["cpu"]]):
        part, cpu = parts.get(name), tree["cpu"].get(name)
        line = f"  {name:<18}" + (
            f"{part.marked(1e3):>12}{100 * (part.value or 0.0) / whole:>7.1f}%" if part else f"{'-':>12}{'':>8}"
        )
        if cpu:
            line += "".join(f"{format_number(cpu[key].value):>10}" for key in ("cpu_ms", "wall_ms"))
            line += f"{cpu['calls'].value:>9.0f}{cpu['items'].value:>10.0f}"
        lines.append(line)
    lines += [
        "",
        *_savings(tree),
        "",
        f"  overhead of the ledger: {format_number(ledger['overhead_us'].value)} us a frame, "
        f"{100 * (ledger['overhead_share'].value or 0):.2f} % of the CPU time",
    ]
    if tree["marks"]:
        lines.append(f"  marked: {', '.join(tree['marks'])}")
    return "\n".join([*lines, *wrapped(tree["test"]), *wrapped(LEGEND)])


def _savings(tree: dict[str, Any]) -> list[str]:
    saved = tree["saved"]
    counts = (
        f"  {format_number(saved['proposals'].value)} proposals a frame, "
        f"beta {format_number(100 * saved['beta'].value)} %, N_go {format_number(saved['N_go'].value)}, "
        f"{format_number(saved['views'].value)} classifications a track"
    )
    if tree["mode"] == "conventional":
        return [counts, "  this is tracking-by-detection itself: nothing was saved; run the other modes, or compare"]
    return [
        counts,
        *wrapped(
            f"saved {saved['saved_J'].marked(1e3)} mJ a frame against tracking-by-detection: "
            f"gamma {saved['gamma_of_this_run'].marked()}"
        ),
        *wrapped(
            f"predicted: {saved['gamma_predicted'].marked()} in full, {saved['gamma_equation_3'].marked()} by "
            f"Equation 3, {saved['gamma_short'].marked()} by N_go alone; a = {saved['a'].marked()}"
        ),
        *terms_text(saved),
        *wrapped("E1 is computed here from this run's own costs; modt-profile compare measures it"),
    ]
