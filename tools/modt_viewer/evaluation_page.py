"""Page of an evaluation: precision and recall by range, their curves, and the lengths of tracks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from modt.classes import CLASS_NAMES, CLASSES
from modt_evaluation.evaluation import ALL, RANGES_M, Evaluation
from modt_evaluation.report import report
from modt_profiling.reporting.document import Page, Plot, Section

if TYPE_CHECKING:  # Matplotlib is an extra
    from matplotlib.axes import Axes

_COLOURS = {name: spec.colour for name, spec in zip(CLASS_NAMES, CLASSES, strict=True)}
_MIDDLE_M = {name: (low + high) / 2 for name, (low, high) in RANGES_M.items() if name != ALL}
"""Middle of each band of range [m]."""


def evaluation_page(sensors: Mapping[str, Evaluation]) -> Page:
    """Page of the evaluation of each sensor, with the text of the report."""
    sections = [
        Section(name, tiles=[*_facts(found)], plots=_plots(found), preformatted=report({name: found}))
        for name, found in sensors.items()
    ]
    frames = max(found.frames for found in sensors.values())
    return Page("Evaluation", f"{', '.join(sensors)}; {frames} frames", sections)


def _facts(found: Evaluation) -> Iterator[tuple[str, str, str]]:
    yield "frames", f"{found.frames}", f"{found.proposals} proposals, {_percent(found.beta)} classified"
    for name, score in found.ranges[ALL].classification.items():
        note = f"precision {_percent(score.precision)}, recall {_percent(score.recall)}"
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
        axes.set(xlabel="recall [%]", ylabel="precision [%]", ylim=(0.0, None))

    def lengths(axes: Axes) -> None:
        kinds = [kind for kind in (ALL, *CLASS_NAMES) if kind in found.tracks]
        axes.bar(kinds, [found.tracks[kind].life.ratio or 0.0 for kind in kinds])
        axes.set(ylabel="share")

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
            shares = {m: getattr(found.ranges[band].classification[name], share) for band, m in _MIDDLE_M.items()}
            known = {middle_m: 100 * value for middle_m, value in shares.items() if value is not None}
            axes.plot([*known], [*known.values()], "o-", color=_COLOURS[name], label=name)
        axes.set(xlabel="range [m]", ylabel="%", ylim=(0.0, None))

    return Plot(title, "of bands of 20 m", draw)


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.0f} %"
