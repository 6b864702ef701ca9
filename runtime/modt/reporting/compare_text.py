"""A comparison as text that fits a terminal; the answers first."""

from __future__ import annotations

import textwrap
from typing import Any

from modt.energy.meters.meter import Kind
from modt.reporting.quantity import Figure, brief

MARK = {Kind.MEASURED: "", Kind.INTEGRATED: "i", Kind.ESTIMATED: "e", Kind.UNAVAILABLE: "?"}
LEGEND = "Figures are measured, but for e estimated, i integrated, ? unavailable. In brackets: 95 %."
WIDTH = 96


def compare_text(tree: dict[str, Any]) -> str:
    """Joules and watts a frame, where they go, what was saved, whether the prediction holds."""
    modes, savings = tree["modes"], tree["savings"]
    lines = [
        f"{tree['stream']}: {tree['frames']} frames, field of view {tree['fov']}, {tree['repeat']} times in turns",
        f"  meter: {tree['meter']['name']} ({tree['meter']['kind']})",
        f"  {conditions_text(tree['conditions'])}",
        "",
        _row("", modes),
        _row("energy a frame [mJ]", [marked(m["net_J"], 1e3) for m in modes.values()]),
        _row(f"  idling counted {tree['basis']}", [marked(m["gross_J"], 1e3) for m in modes.values()]),
        _row("cpu a frame [ms]", [marked(m["cpu_ms"]) for m in modes.values()]),
        *(
            _row(f"  {stage}", [_stage(m["stages"][stage]) for m in modes.values()])
            for stage in next(iter(modes.values()))["stages"]
        ),
        _row("classified a frame", [marked(m["classified"]) for m in modes.values()]),
        _row("beta [%]", [marked(m["beta"], 1e2) for m in modes.values()]),
        _row("N_go [frames]", [marked(m["N_go"]) for m in modes.values()]),
        _row("views a track", [marked(m["views"]) for m in modes.values()]),
        "",
    ]
    for mode, s in savings.items():
        lines += [
            f"{mode}: gamma measured {s['gamma_measured_cpu'].text()}, predicted {s['gamma_predicted'].text()} (e)",
            *wrapped(holds(s)),
            *wrapped(
                f"energy: gamma {marked(s['gamma_net'])} with idling taken off, {marked(s['gamma_gross'])} with it; "
                f"{marked(s['saved_J'], 1e3)} mJ a frame saved{_against_meter(s)}"
            ),
            f"  {'from N_go to what was measured':<50}{'change e':>10}{'gamma e':>10}",
            f"  {'the short form, gamma = N_go':<50}{'':>10}{marked(s['gamma_short']):>10}",
            *(f"  {t['name']:<50}{t['change'].value:>+10.3f}{t['gamma'].value:>10.3f}" for t in s["terms"]),
            "",
        ]
    return "\n".join([*lines, *wrapped(tree["test"]), *wrapped(LEGEND)])


def wrapped(text: str) -> list[str]:
    """A sentence in lines that fit a terminal."""
    return textwrap.wrap(text, WIDTH, initial_indent="  ", subsequent_indent="    ")


def holds(saving: dict[str, Any]) -> str:
    """Whether the prediction holds, in a sentence."""
    deviation, a = saving["deviation"], saving["a"]
    verdict = "holds within 5 %" if abs(deviation.value) <= 0.05 else "does NOT hold within 5 %"
    short = saving["short_form_error"]
    spread = f"{100 * deviation.low:+.1f} to {100 * deviation.high:+.1f}"
    return (
        f"the prediction {verdict}: off by {100 * deviation.value:+.1f}e % ({spread}); "
        f"at a = {marked(a)} N_go alone errs by {100 * short.value:+.0f}e %"
    )


def conditions_text(conditions: dict[str, Any]) -> str:
    """Governor and frequency, as far as the machine tells."""
    governor, frequency = conditions.get("governor"), conditions.get("frequency_MHz")
    return (
        f"governor {governor or 'unavailable'}, "
        f"frequency {'unavailable' if frequency is None else f'{frequency:.0f} MHz'}, core {conditions.get('core')}"
    )


def marked(figure: Figure, by: float = 1.0) -> str:
    """Value and mark of its kind, without its interval."""
    if figure.value is None:
        return "unavailable"
    return f"{brief(figure.value * by)}{MARK[figure.kind]}"


def _against_meter(saving: dict[str, Any]) -> str:
    off, calibrated = saving["deviation_net"].value, saving["gamma_calibrated"]
    joules = "" if calibrated.value is None else f"; by calibrated joules gamma is {marked(calibrated)}"
    if saving["gamma_net"].kind is Kind.ESTIMATED or off is None:
        return joules
    return f"{joules}; predicted is off by {100 * off:+.1f} % against the meter"


def _stage(stage: dict[str, Figure]) -> str:
    return f"{brief(stage['cpu_ms'].value)}"


def _row(name: str, cells: Any) -> str:
    return f"  {name:<34}" + "".join(f"{cell:>16}" for cell in cells)
