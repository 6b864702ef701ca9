"""An evaluation as a table that a person can read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from modt.evaluation.evaluation import ALL, Evaluation
from modt.evaluation.track_score import TrackScore

CLASS_TABLES = (
    ("average precision [%]", "average_precision", "objects"),
    ("precision as said [%]", "precision", "called"),
    ("recall as said [%]", "recall", "segmentable"),
)
"""Title, figure and count of each."""
METRICS = ("HOTA", "DetA", "AssA", "MOTA", "IDF1")


def report(sensors: Mapping[str, Evaluation]) -> str:
    """The evaluation of each sensor, one after the other."""
    return "\n\n".join("\n".join(_lines(name, found)) for name, found in sensors.items())


def _lines(name: str, e: Evaluation) -> Iterator[str]:
    yield f"{name}: {e.drives} drives, {e.frames} frames, {e.proposals} proposals, beta {_percent(e.beta)} %"
    yield ""
    yield from _table(
        ["segmentation [%]", *e.ranges, "objects", "merged", "split", "partial", "missed", "cut"],
        [
            [
                kind,
                *(
                    _percent(band.segmentation[kind].recall if kind in band.segmentation else None)
                    for band in e.ranges.values()
                ),
                *(str(n) for n in (s.objects, s.merged, s.split, s.partial, s.missed, s.cut)),
            ]
            for kind, s in e.ranges[ALL].segmentation.items()
        ],
    )
    yield ""
    for title, key, counted in CLASS_TABLES:
        scores = e.ranges[ALL].classification
        cells = {c: [_percent(getattr(band.classification[c], key)) for band in e.ranges.values()] for c in scores}
        rows = [[c, *cells[c], str(getattr(score, counted))] for c, score in scores.items()]
        yield from _table([title, *e.ranges, counted], rows)
        yield ""
    errors = ", ".join(f"{c} {_percent(s.calibration_error)}" for c, s in e.ranges[ALL].classification.items())
    yield (
        f"  calibration error {_percent(e.calibration_error)} % of proposals, "
        f"{_percent(e.calibration_error_of_objects)} % of objects; {errors}"
    )
    if e.tracks:
        yield ""
        yield from _table(
            [
                "tracks",
                "objects",
                "life",
                "ideal",
                "ratio",
                "as seen",
                "ideal",
                "labelled",
                "breaks",
                "taken",
                "mixed",
            ],
            [[kind, *_track_cells(s)] for kind, s in e.tracks.items() if s.life.objects],
        )
    if e.metrics:
        yield ""
        yield from _table(
            ["metrics [%]", *METRICS, "id switches", "fragments"],
            [
                [
                    kind,
                    *(_percent(m[key]) for key in METRICS),
                    f"{m['id_switches']:.0f}",
                    f"{m['fragmentations']:.0f}",
                ]
                for kind, m in e.metrics.items()
            ],
        )
    elif e.tracks:
        yield "  HOTA, CLEAR and Identity: pip install 'modt[evaluate]'"


def _track_cells(s: TrackScore) -> list[str]:
    lives = (s.life.life, s.life.ideal), (s.life_as_seen.life, s.life_as_seen.ideal)
    (life, ideal), (seen, ideal_seen) = ([_number(v) for v in pair] for pair in lives)
    counts = (s.discontinuities, s.taken_over, s.mis_associations)
    ratio = "-" if s.life.ratio is None else f"{s.life.ratio:.2f}"
    return [str(s.life.objects), life, ideal, ratio, seen, ideal_seen, _number(s.labelled.ideal), *map(str, counts)]


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Lines of aligned columns, the first to the left."""
    widths = [max(len(row[k]) for row in (head, *rows)) for k in range(len(head))]
    for row in (head, *rows):
        yield (
            "  " + row[0].ljust(widths[0]) + "".join(f"  {c:>{w}}" for c, w in zip(row[1:], widths[1:], strict=True))
        )


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.1f}"
