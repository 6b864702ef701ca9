"""Page of an evaluation: precision and recall by range, their curves, and the lengths of tracks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from modt.classes import CLASS_NAMES, CLASSES
from modt_evaluation.evaluation import ALL, RANGES_M, Evaluation
from modt_evaluation.report import report
from modt_profiling.reporting import svg
from modt_profiling.reporting.document import Plot, page, plots, preformatted, tiles

_COLOURS = {name: spec.colour for name, spec in zip(CLASS_NAMES, CLASSES.values(), strict=True)}
_MIDDLE_M = {name: (low + high) / 2 for name, (low, high) in RANGES_M.items() if name != ALL}
_BY_RANGE = {
    "precision": "Precision of the reported class, by range",
    "recall": "Recall with the right class, by range",
}


def evaluation_page(sensors: Mapping[str, Evaluation]) -> str:
    """HTML of the evaluation of each sensor, with the text of the report."""
    blocks = []
    for name, found in sensors.items():
        blocks += [
            f"<h2>{name}</h2>",
            tiles(_facts(found)),
            plots(_plots(found)),
            preformatted(report({name: found})),
        ]
    frames = max(found.frames for found in sensors.values())
    return page("Evaluation", f"{', '.join(sensors)}; {frames} frames", blocks)


def _facts(found: Evaluation) -> Iterator[tuple[str, str, str]]:
    yield "frames", f"{found.frames}", f"{found.proposals} proposals, {_percent(found.beta)} classified"
    for name, score in found.ranges[ALL].classification.items():
        note = f"precision {_percent(score.precision)}, recall {_percent(score.recall)}"
        yield f"average precision, {name}", _percent(score.average_precision), note
    if ALL in found.tracks:
        length = found.tracks[ALL].life
        if length.life is not None and length.ideal is not None:
            yield "length of an object's track", f"{length.life:.1f} frames", f"of {length.ideal:.1f} ideal"


def _plots(found: Evaluation) -> Iterator[Plot]:
    scores = found.ranges[ALL].classification
    for key, title in _BY_RANGE.items():
        traces = []
        for name in scores:
            shares = {middle: getattr(found.ranges[b].classification[name], key) for b, middle in _MIDDLE_M.items()}
            known = {middle: 100 * share for middle, share in shares.items() if share is not None}
            traces.append(_trace(name, list(known), list(known.values())))
        yield title, svg.lines(traces, "range [m]", "%"), "of bands of 20 m"
    curves = [
        _trace(n, [100 * r for _, _, r in s.curve], [100 * p for _, p, _ in s.curve]) for n, s in scores.items()
    ]
    yield "Precision over recall", svg.lines(curves, "recall [%]", "precision [%]"), "by posterior"
    kinds = [kind for kind in (ALL, *CLASS_NAMES) if kind in found.tracks]
    lengths = np.array([found.tracks[kind].life.ratio or 0.0 for kind in kinds])
    edges = np.arange(len(kinds) + 1, dtype=np.float64) - 0.5
    note = ", ".join(f"{k}: {kind}" for k, kind in enumerate(kinds)) or "labels without identities"
    yield "Length of tracks, of the ideal", svg.bars(edges, lengths, "objects", "share"), note


def _trace(name: str, x: list[float], y: list[float]) -> svg.Trace:
    return svg.Trace(name, np.array(x, float), np.array(y, float), colour=_COLOURS[name])


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.0f} %"
