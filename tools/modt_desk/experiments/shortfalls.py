"""Where the figures fall short of the paper's, in words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from modt_desk.experiments import paper
from modt_desk.experiments.catalogue.accuracy import DETECTION, TRACKING
from modt_desk.experiments.catalogue.every import EXPERIMENTS
from modt_desk.experiments.drives import KITTI
from modt_desk.experiments.study import DEFAULT, Row

_BETTER_HIGH = ("AP ", "N_go of objects")
_BETTER_LOW = ("beta", "mis-associations", "discontinuities")
_ACCURACY = ("table4", "table5")


def shortfalls(rows: Sequence[Row]) -> Iterator[str]:
    """A section: figures behind the paper's, what tracking adds here and there, what cannot be compared."""
    yield from ("## Where this falls short", "")
    behind: dict[str, list[str]] = {}
    for row in rows:
        if row.paper is not None and row.value is not None and _behind(row, row.value, row.paper):
            at = "" if row.at is None else f" at {row.at:g}"
            behind.setdefault(_place(row), []).append(
                f"{row.quantity}{at} {number(row.value)}, not {number(row.paper)}"
            )
    yield "Behind the paper:" if behind else "On the drives at hand no figure is behind the paper's."
    yield from ("", *(f"- {place}: {'; '.join(figures)}" for place, figures in behind.items()))
    gains = list(_gains(rows))
    if gains:
        yield from ("", "What tracking adds to average precision, in points, the paper's in brackets:", "", *gains)
    yield from ("", *_not_compared(rows))


def number(value: float) -> str:
    """Three digits."""
    return f"{value:.0f}" if abs(value) >= 100 or value == int(value) else f"{value:.3g}"


def _behind(row: Row, value: float, stated: float) -> bool:
    low, high = row.quantity.startswith(_BETTER_LOW), row.quantity.startswith(_BETTER_HIGH)
    return (low and value > 1.05 * stated) or (high and value < stated)


def _gains(rows: Sequence[Row]) -> Iterator[str]:
    """Of each table and streams."""
    found: dict[str, list[str]] = {}
    without = {(_place(r), r.quantity): r for r in rows if r.variant == DETECTION}
    for row in rows:
        before = without.get((_place(row).replace(TRACKING, DETECTION), row.quantity))
        if row.experiment not in _ACCURACY or row.variant != TRACKING or before is None:
            continue
        if row.value is not None and before.value is not None:
            stated = "" if row.paper is None or before.paper is None else f" ({_points(row.paper - before.paper)})"
            words = f"{row.quantity[3:]} {_points(row.value - before.value)}{stated}"
            found.setdefault(_place(row).replace(f", {TRACKING}", ""), []).append(words)
    return (f"- {place}: {', '.join(words)}" for place, words in found.items())


def _points(share: float) -> str:
    return f"{100 * share:+.1f}"


def _not_compared(rows: Sequence[Row]) -> Iterator[str]:
    with_scans = {row.streams[:4] for row in rows if row.kind == KITTI and row.experiment in _ACCURACY}
    lacking = [drive for drive in paper.DRIVES if drive not in with_scans]
    if lacking and with_scans:
        yield f"Sweeps of the paper's drives {', '.join(lacking)} were not at hand: its means over eight drives"
        yield "stand beside figures of fewer."
    few = sorted({(r.n, r.streams, r.quantity) for r in rows if r.kind == KITTI and r.n is not None and _few(r)})
    if few:
        named = "; ".join(f"{quantity[3:]}: {n} on {streams}" for n, streams, quantity in few)
        yield f"Too few objects to tell ({named}): such intervals say little, or there is none."
    yield "Simulated drives are cleaner than real ones: what they rank may not hold on a road. The detector that the"
    yield "paper stops at 40 epochs is another network; the profile that stands for it can be put beside this one."


def _few(row: Row) -> bool:
    return row.experiment in _ACCURACY and row.quantity.startswith("AP ") and (row.n or 0) < 5


def _place(row: Row) -> str:
    title = EXPERIMENTS[row.experiment].title.partition(":")[0]
    names = "" if row.profile == DEFAULT else f", profile {row.profile}"
    return f"{title}, {row.streams}{names}, {row.variant}"
