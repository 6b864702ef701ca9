"""A comparison of the modes as text for a terminal, results first."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable
from typing import Any

from modt.energy.meters.meter import Kind
from modt.reporting.quantity import LEGEND, format_number


def compare_text(tree: dict[str, Any]) -> str:
    """Energy a frame, its distribution, the energy saved, and whether the prediction holds."""
    modes = tree["modes"].values()

    def row(name: str, key: str, scale: float = 1.0) -> str:
        return _row(name, (m[key].marked(scale) for m in modes))

    lines = [
        f"{tree['stream']}: {tree['frames']} frames, field of view {tree['fov']}, "
        f"{tree['repeat']} repetitions, modes interleaved",
        f"  meter: {tree['meter']['name']} ({tree['meter']['kind']})",
        f"  {conditions_text(tree['conditions'])}",
        "",
        _row("", tree["modes"]),
        row("energy a frame [mJ]", "net_J", 1e3),
        row(f"  with idling, {tree['basis']}", "gross_J", 1e3),
        row("cpu a frame [ms]", "cpu_ms"),
        *(
            _row(f"  {stage}", (format_number(m["stages"][stage]["cpu_ms"].value) for m in modes))
            for stage in next(iter(modes))["stages"]
        ),
        row("classified a frame", "classified"),
        row("beta [%]", "beta", 1e2),
        row("N_go [frames]", "N_go"),
        row("views a track", "views"),
        "",
    ]
    for mode, s in tree["savings"].items():
        lines += [
            f"{mode}: gamma measured {s['gamma_measured_cpu'].text()}, predicted {s['gamma_predicted'].text()} (e)",
            *wrapped(verdict(s)),
            *wrapped(
                f"energy: gamma {s['gamma_net'].marked()} without idling, {s['gamma_gross'].marked()} with idling; "
                f"{s['saved_J'].marked(1e3)} mJ a frame saved{_against_meter(s)}"
            ),
            *terms_text(s),
            "",
        ]
    return "\n".join([*lines, *wrapped(tree["test"]), *wrapped(LEGEND)])


def terms_text(saving: dict[str, Any]) -> list[str]:
    """Table of the terms from gamma = N_go to the ratio of the runs."""
    return [
        f"  {'from N_go to gamma':<50}{'change e':>10}{'gamma e':>10}",
        f"  {'the short form, gamma = N_go':<50}{'':>10}{saving['gamma_short'].marked():>10}",
        *(f"  {t['name']:<50}{t['change'].value:>+10.3f}{t['gamma'].value:>10.3f}" for t in saving["terms"]),
    ]


def wrapped(text: str) -> list[str]:
    """A sentence in lines of 96 columns at most."""
    return textwrap.wrap(text, 96, initial_indent="  ", subsequent_indent="    ")


def verdict(saving: dict[str, Any]) -> str:
    """Whether the prediction holds, with its deviation and interval."""
    deviation, short = saving["deviation"], saving["short_form_error"]
    holds = "holds within 5 %" if abs(deviation.value) <= 0.05 else "does NOT hold within 5 %"
    interval = f"{100 * deviation.low:+.1f} to {100 * deviation.high:+.1f}"
    return (
        f"the prediction {holds}: deviation {100 * deviation.value:+.1f}e % ({interval}); "
        f"at a = {saving['a'].marked()} the error of gamma = N_go is {100 * short.value:+.0f}e %"
    )


def conditions_text(conditions: dict[str, Any]) -> str:
    """Governor, frequency and core, where available."""
    governor, frequency = conditions.get("governor"), conditions.get("frequency_MHz")
    return (
        f"governor {governor or 'unavailable'}, "
        f"frequency {'unavailable' if frequency is None else f'{frequency:.0f} MHz'}, core {conditions.get('core')}"
    )


def _against_meter(saving: dict[str, Any]) -> str:
    deviation, calibrated = saving["deviation_net"].value, saving["gamma_calibrated"]
    text = "" if calibrated.value is None else f"; gamma by calibrated joules is {calibrated.marked()}"
    if saving["gamma_net"].kind is Kind.ESTIMATED or deviation is None:
        return text
    return f"{text}; deviation of the prediction {100 * deviation:+.1f} % against the meter"


def _row(name: str, cells: Iterable[str]) -> str:
    return f"  {name:<34}" + "".join(f"{cell:>16}" for cell in cells)
