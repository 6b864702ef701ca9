"""Page of an evaluation: precision and recall by range, their curves, and the lengths of tracks."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from modt.classes import CLASS_NAMES, CLASSES
from modt.viewer.theme import COLOURS
from modt_evaluation.evaluation import ALL, RANGES_M, Evaluation
from modt_evaluation.report import report
from modt_profiling.reporting.document import Page, Plot, Section

if TYPE_CHECKING:  # Matplotlib is an extra
    from matplotlib.axes import Axes

_COLOURS = {name: spec.colour for name, spec in zip(CLASS_NAMES, CLASSES, strict=True)}
_BANDS = [name for name in RANGES_M if name != ALL]
"""Names of the bands of range."""
_PERCENT = (0.0, 104.0)
"""Limits of an axis of percents, with room for a mark at 100."""


def evaluation_page(sensors: Mapping[str, Evaluation]) -> Page:
    """Page of the evaluation of each sensor, with the text of the report."""
    sections = [section for name, found in sensors.items() for section in _sections(name, found)]
    frames = max(found.frames for found in sensors.values())
    return Page("Evaluation", f"{', '.join(sensors)}; {frames} frames", sections)


def _sections(name: str, found: Evaluation) -> Iterator[Section]:
    """Answers and plots under what the report says of its truth, then the text of the report."""
    text = report({name: found})
    about = [text.splitlines()[1].strip()]
    yield Section(name, lines=about, tiles=[*_facts(found)], plots=_plots(found))
    yield Section("All figures", preformatted=text)


def _facts(found: Evaluation) -> Iterator[tuple[str, str, str]]:
    yield "frames", f"{found.frames}", f"{found.proposals} proposals, {_percent(found.beta)} classified"
    for name, score in found.ranges[ALL].classification.items():
        note = f"precision {_percent(score.precision)}, recall {_percent(score.recall)} of the segmentable"
        yield f"average precision, {name}", _percent(score.average_precision), note
    if ALL in found.tracks:
        length = found.tracks[ALL].life
        if length.life is not None and length.ideal is not None:
            yield "length of an object's track", f"{length.life:.1f} frames", f"of {length.ideal:.1f} ideal"


def _plots(found: Evaluation) -> list[Plot]:
    def curves(axes: Axes) -> None:
        for name, score in found.ranges[ALL].classification.items():
            recall = [100 * recall for _, _, recall in score.curve]
            precision = [100 * precision for _, precision, _ in score.curve]
            axes.plot(recall, precision, color=_COLOURS[name], label=name)
        axes.set(xlabel="recall [%]", ylabel="precision [%]", xlim=_PERCENT, ylim=_PERCENT)

    def lengths(axes: Axes) -> None:
        kinds = [kind for kind in (ALL, *CLASS_NAMES) if kind in found.tracks]
        colours = [_COLOURS.get(kind, COLOURS[5]) for kind in kinds]
        axes.bar(kinds, [100 * (found.tracks[kind].life.ratio or 0.0) for kind in kinds], color=colours)
        axes.set(ylabel="% of the ideal length", ylim=_PERCENT)

    return [
        _by_range(found, "precision", "Precision of the reported class, by range"),
        _by_range(found, "recall", "Recall with the right class, by range"),
        Plot("Precision over recall", "by posterior", curves),
        Plot("Length of tracks, of the ideal", "" if found.tracks else "labels without identities", lengths),
    ]


def _by_range(found: Evaluation, share: str, title: str) -> Plot:
    """Precision or recall of each class over the range."""

    def draw(axes: Axes) -> None:
        for name in found.ranges[ALL].classification:
            shares = [getattr(found.ranges[band].classification[name], share) for band in _BANDS]
            percents = [math.nan if value is None else 100 * value for value in shares]
            axes.plot(_BANDS, percents, "o-", color=_COLOURS[name], label=name)
        axes.set(xlabel="range [m]", ylabel="%", xlim=(-0.2, len(_BANDS) - 0.8), ylim=_PERCENT)

    return Plot(title, "a band without a point has too few objects", draw)


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.0f} %"
