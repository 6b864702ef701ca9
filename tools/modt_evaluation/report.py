"""An evaluation as a table that a person can read."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType

from modt.classes import CLASS_NAMES
from modt.errors import install
from modt_evaluation.evaluation import ALL, Evaluation
from modt_evaluation.nuscenes_results import ERRORS, NuscenesScore
from modt_profiling.reporting.quantity import aligned

CLASS_TABLES = (
    ("average precision [%] by range [m]", "average_precision", "objects"),
    ("precision of the reported classes [%]", "precision", "called"),
    ("objects reported with their class [%]", "objects_called", "objects"),
    ("recall with the right class [%]", "recall", "segmentable"),
)
"""Title of a table, its figure, and the count that the figure is a share of."""
FAILURES = ("merged", "split", "partial", "missed", "cut")
TRACKS = ["objects", "length", "ideal", "ratio", "as seen", "its ideal", "labelled", "breaks", "taken", "mixed"]
METRICS = ("HOTA", "DetA", "AssA", "MOTA", "IDF1")
EVENTS = ("id_switches", "fragmentations")
BOXES = (
    *("matched", "centre [m]", "shape", "heading [rad]", "axis [rad]", "velocity [m/s]", "moving", "theirs [m/s]"),
    *("IoU .7/.5/.5", "IoU .5/.25/.25"),
)
NUSCENES = ("objects", "AP [%]", "ATE [m]", "ASE", "AOE [rad]", "AVE [m/s]")
REACTION = ("entered", "median", "p90", "never", "at start", "median", "p90", "never")
LEGEND = "  Rows car, pedestrian, cyclist: classes (vans as cars, unless --classes paper); others: types of labels."

COMPLETE = "labels are taken for complete"
INCOMPLETE = "labels of KITTI, unlike simulated ones, leave out road users"


def report(sensors: Mapping[str, Evaluation], nuscenes: Mapping[str, NuscenesScore] = MappingProxyType({})) -> str:
    """The evaluation of each sensor, one after the other, and the score of nuScenes' benchmark."""
    parts = ["\n".join(_lines(name, found)) for name, found in sensors.items()]
    rows = [
        [name, s.objects, _percent(s.ap), *(f"{getattr(s, error):.3f}" for error in ERRORS)]
        for name, s in nuscenes.items()
    ]
    if rows:
        parts.append("\n".join(_table("nuScenes' detection benchmark", NUSCENES, rows)))
    return "\n\n".join(parts)


def _lines(name: str, e: Evaluation) -> Iterator[str]:
    drives = "1 drive" if e.drives == 1 else f"{e.drives} drives"
    size = f"{drives}, {e.frames} frames, {e.proposals} proposals"
    yield f"{name}: {size}, beta {_percent(e.beta)} %, judged {_sector(e)}"
    yield f"  Truth: {_completeness(e)}."
    yield from _segmentation(e)
    yield from _classes(e)
    yield from _tracks(e)
    yield from _boxes(e)
    yield from _reaction(e)


def _segmentation(e: Evaluation) -> Iterator[str]:
    kinds = e.ranges[ALL].segmentation
    rows = []
    for kind, score in kinds.items():
        found = [band.segmentation.get(kind) for band in e.ranges.values()]
        recall = [_percent(in_band.recall if in_band else None) for in_band in found]
        rows.append([kind, *recall, score.objects, *(getattr(score, failure) for failure in FAILURES)])
    if not kinds.keys() <= set(CLASS_NAMES):
        yield LEGEND
    yield from _table("segmentation: recall [%] by range [m], and counts", [*e.ranges, "objects", *FAILURES], rows)


def _classes(e: Evaluation) -> Iterator[str]:
    whole = e.ranges[ALL].classification
    for title, key, count in CLASS_TABLES:
        rows = []
        for name, score in whole.items():
            shares = [_percent(getattr(band.classification[name], key)) for band in e.ranges.values()]
            rows.append([name, *shares, getattr(score, count)])
        yield from _table(title, [*e.ranges, count], rows)
    errors = {"proposals": e.calibration_error, "objects": e.calibration_error_of_objects}
    errors |= {name: score.calibration_error for name, score in whole.items()}
    yield from _table("calibration error [%]", [*errors], [["", *map(_percent, errors.values())]])


def _tracks(e: Evaluation) -> Iterator[str]:
    if not e.tracks:
        return
    rows = []
    for kind, t in e.tracks.items():
        if t.life.objects:
            lengths = [_number(t.life.life), _number(t.life.ideal), _number(t.life.ratio, 2)]
            lengths += map(_number, (t.life_as_seen.life, t.life_as_seen.ideal, t.labelled.ideal))
            rows.append([kind, t.life.objects, *lengths, t.discontinuities, t.taken_over, t.mis_associations])
    yield from _table("tracks: mean length [frames], and counts", TRACKS, rows)
    if e.metrics is None:
        yield f"\n  {', '.join(METRICS)}, {' and '.join(EVENTS)} need trackeval: {install('evaluate')}"
    elif e.metrics:
        measured = e.metrics.items()
        rows = [[k, *(_percent(m[n]) for n in METRICS), *(_number(m[n], 0) for n in EVENTS)] for k, m in measured]
        yield from _table("metrics [%], and counts", [*METRICS, *EVENTS], rows)


def _boxes(e: Evaluation) -> Iterator[str]:
    rows = []
    for name, box in e.boxes.items():
        errors = (box.translation_m, box.scale, box.orientation_rad, box.axis_rad, box.velocity_mps)
        of_all = [box.matched, *(_number(error, 3) for error in errors)]
        of_moving = [box.moving, _number(box.velocity_moving_mps, 3)]
        rows.append([name, *of_all, *of_moving, _percent(box.strict_ap), _percent(box.loose_ap)])
    title = (
        "boxes and velocities: mean errors of the objects reported with their class, and average precision in 3D [%]"
    )
    yield from _table(title, BOXES, rows)


def _reaction(e: Evaluation) -> Iterator[str]:
    rows = []
    for name, r in e.reaction.items():
        entered = (r.entered, _number(r.median_frames), _number(r.p90_frames), r.never)
        at_start = (r.at_start, _number(r.at_start_median_frames), _number(r.at_start_p90_frames), r.at_start_never)
        rows.append([name, *entered, *at_start])
    title = (
        "reaction: frames from 20 points within 30 m until reported, of what enters and of what is there at the start"
    )
    yield from _table(title, REACTION, rows)


def _sector(e: Evaluation) -> str:
    """The sectors in which proposals are judged, in words."""
    sectors = ("all round" if half >= 180 else f"within {half:g} degrees of straight ahead" for half in e.sectors_deg)
    return " or ".join(sectors)


def _completeness(e: Evaluation) -> str:
    """Completeness of the labels, in words."""
    labels = COMPLETE if e.complete else INCOMPLETE
    if e.further_objects:
        what = f"{e.further_objects} objects" if e.complete else f"{e.further_objects} of them"
        return f"{labels}; --further adds {what}, in {e.further_labels} labels"
    return labels if e.complete else f"{labels}, and tracks on those count as false; --further FILE adds them"


def _table(title: str, head: Sequence[str], rows: Iterable[Sequence[object]]) -> Iterator[str]:
    """The title and lines of aligned columns, the first to the left."""
    yield from ("", f"  {title}", *aligned([[str(cell) for cell in row] for row in (("", *head), *rows)]))


def _number(value: float | None, digits: int = 1) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def _percent(value: float | None) -> str:
    return _number(None if value is None else 100 * value)
