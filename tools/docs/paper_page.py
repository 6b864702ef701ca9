"""Figures of docs/paper.md, from the rows of the experiments."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from modt_evaluation.experiments import paper
from modt_evaluation.experiments.catalogue import DETECTION, EXPERIMENTS, TRACKING
from modt_evaluation.experiments.drives import KITTI
from modt_evaluation.experiments.markdown import number
from modt_evaluation.experiments.study import DEFAULT, Row

NAMES = ("table3", "table4", "table5", "table6")
"""Experiments that the page shows."""
CLASSES = ("car", "pedestrian", "cyclist")
_PRECISIONS = ("table4", "table5")
_TRACKS = ("objects", "N_go of objects", "discontinuities", "mis-associations", "beta")
_BETTER_LOW = ("beta", "mis-associations", "discontinuities")
_BETTER_HIGH = ("AP ", "N_go of objects")
_MARGIN = 1.05
"""Factor above which a figure that should be low counts as worse than the paper's."""


def section(rows: Sequence[Row], about: str) -> str:
    """Both tables, and the figures that are worse than the paper's."""
    lines = [about, "", *_precisions(rows), "", *_tracks(rows), "", "## Where this falls short", "", *_behind(rows)]
    return "\n".join(lines)


def _precisions(rows: Sequence[Row]) -> Iterator[str]:
    """Average precision without and with tracking, a row for each table, group of drives and profile."""
    yield f"| average precision without tracking, with it [%] | {' | '.join(CLASSES)} |"
    yield "|---|" + "---|" * len(CLASSES)
    for name in _PRECISIONS:
        title = EXPERIMENTS[name].title.partition(":")[0]
        stated = [paper.figure(name, "", v, None, f"AP {c}") for c in CLASSES for v in (DETECTION, TRACKING)]
        values = [None if found is None else found[0] for found in stated]
        yield _line(f"**{title}, the paper, eight drives**", zip(values[::2], values[1::2], strict=True))
        of_table = [row for row in rows if row.experiment == name]
        for streams, profile in dict.fromkeys((row.streams, row.profile) for row in of_table):
            value_of = {
                (row.variant, row.quantity): row.value
                for row in of_table
                if (row.streams, row.profile) == (streams, profile)
            }
            pairs = [(value_of.get((DETECTION, f"AP {c}")), value_of.get((TRACKING, f"AP {c}"))) for c in CLASSES]
            yield _line(f"{title}, {streams}, {_profile(profile)}", pairs)


def _line(
    name: str, pairs: Iterator[tuple[float | None, float | None]] | Sequence[tuple[float | None, float | None]]
) -> str:
    cells = [
        "-" if a is None or b is None else f"{100 * a:.1f}, {100 * b:.1f} ({100 * (b - a):+.1f})" for a, b in pairs
    ]
    return f"| {name} | {' | '.join(cells)} |"


def _tracks(rows: Sequence[Row]) -> Iterator[str]:
    """Table VI on recorded drives, judged by the labels alone."""
    of_table = [row for row in rows if row.experiment == "table6" and row.kind == KITTI]
    yield f"| tracks | {' | '.join(_TRACKS)} |"
    yield "|---|" + "---|" * len(_TRACKS)
    for streams in dict.fromkeys(row.streams for row in of_table if row.paper is not None):
        of_streams = [row for row in of_table if row.streams == streams]
        stated = {row.quantity: row.paper for row in of_streams}
        yield _cells(f"**Table VI, the paper, {streams}**", stated)
        for profile, variant in dict.fromkeys((row.profile, row.variant) for row in of_streams):
            value_of = {
                row.quantity: row.value for row in of_streams if (row.profile, row.variant) == (profile, variant)
            }
            yield _cells(f"{streams}, {_profile(profile)}, mode {variant}", value_of)


def _cells(name: str, of: dict[str, float | None]) -> str:
    values = [of.get(quantity) for quantity in _TRACKS]
    return f"| {name} | {' | '.join('-' if value is None else number(value) for value in values)} |"


def _behind(rows: Sequence[Row]) -> Iterator[str]:
    """List of the figures that are worse than the paper's, judged by the labels alone."""
    found: dict[str, list[str]] = {}
    for row in rows:
        if row.paper is None or row.value is None:
            continue
        low = row.quantity.startswith(_BETTER_LOW)
        high = row.quantity.startswith(_BETTER_HIGH)
        if (low and row.value > _MARGIN * row.paper) or (high and row.value < row.paper):
            place = f"{EXPERIMENTS[row.experiment].title.partition(':')[0]}, {row.streams}, {_profile(row.profile)}"
            words = f"{row.quantity} {number(row.value)}, not {number(row.paper)}"
            found.setdefault(f"{place}, {row.variant}", []).append(words)
    yield "Behind the paper:" if found else "No figure is behind the paper's."
    yield from ("", *(f"- {place}: {'; '.join(figures)}" for place, figures in found.items()))


def _profile(names: str) -> str:
    return "default profile" if names == DEFAULT else f"profile `{names}`"
