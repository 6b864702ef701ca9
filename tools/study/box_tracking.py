"""HOTA, MOTA and IDF1 of `modt track` on KITTI tracking sequences, by threshold of the detection score.

    python -m tools.study.box_tracking --detections FOLDER... --labels label_02 [--online] [--cut MIN:MAX:STEP]

Matches are by 3D IoU. As in KITTI, boxes on neighbouring classes, on objects that do not count, in DontCare areas and
of less than 25 pixels are left out, and so are sequences without objects of the class. `as written` uses the default
threshold, `best cut` the one of highest HOTA, and `left out` judges each sequence by the threshold that is best on
all others. The sequence of drive 0005 takes no part.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.optimize import linear_sum_assignment

from modt.types import Bool, Float64, Int
from modt_desk.box_tracking.detections import Detections, boxes_from_kitti, files, merge, read
from modt_desk.box_tracking.sequences import follow, iou_3d
from modt_desk.evaluation.rows import Association
from modt_desk.evaluation.track_score import track_metrics
from tools.options import parser

NEIGHBOURS = {"Pedestrian": ("Person_sitting", "Person"), "Car": ("Van",), "Cyclist": ()}
FIGURES = ("HOTA", "AssA", "DetA", "MOTA", "IDF1")
MIN_HEIGHT_PX, MIN_IOU, TEST = 25, 0.25, "0000"

Objects = dict[int, list[list[str]]]
"""Fields of the lines of a label file, by frame."""
Judged = dict[str, list[Association]]
"""Boxes and their similarities in each frame of a sequence."""


def objects(text: str) -> Objects:
    """Lines of a KITTI tracking file."""
    found = defaultdict(list)
    for line in text.splitlines():
        found[int(line.split(" ", 1)[0])].append(line.split())
    return found


def columns(rows: Sequence[Sequence[str]]) -> tuple[Int, Float64, Float64]:
    """(n,) identities, (n, 4) image boxes, (n, 7) boxes."""
    numbers = np.array([row[6:17] for row in rows], np.float64).reshape(-1, 11)
    return np.array([row[1] for row in rows], np.int64), numbers[:, :4], boxes_from_kitti(numbers[:, 4:])


def inside(image_box: Float64, areas: Float64) -> Bool:
    """(n,) whether more than half of an image box lies in one of the areas."""
    low, high = (f(image_box[:, None, k], areas[:, k]) for f, k in ((np.maximum, [0, 1]), (np.minimum, [2, 3])))
    own = (image_box[:, 2:] - image_box[:, :2]).prod(axis=1)
    within: Bool = ((np.maximum(high - low, 0).prod(axis=2)) > 0.5 * own[:, None]).any(axis=1)
    return within


def association(kind: str, truth: Sequence[Sequence[str]], tracked: Sequence[Sequence[str]]) -> Association:
    """Overlap of the tracks of a class in a frame with the objects that count."""
    labelled = [row for row in truth if row[2] in (kind, *NEIGHBOURS[kind])]
    counts = np.array([row[2] == kind and float(row[3]) <= 0 and float(row[4]) <= 2 for row in labelled], np.bool_)
    (id_, _, box), (track, image_box, own) = columns(labelled), columns([row for row in tracked if row[2] == kind])
    i, k = (a.ravel() for a in np.indices((len(box), len(own))))
    iou = iou_3d(box[i], own[k]).reshape(len(box), len(own))
    rows, taken = linear_sum_assignment(-iou)
    matched = iou[rows, taken] >= MIN_IOU
    free = image_box[:, 3] - image_box[:, 1] < MIN_HEIGHT_PX
    free |= inside(image_box, columns([row for row in truth if row[2] == "DontCare"])[1])
    free[taken[matched]] = False
    free[taken[matched & ~counts[rows]]] = True
    return Association(id_[counts], track[~free], iou[counts][:, ~free])


def judge(sequences: Sequence[Detections], labels: Path, cut: float | None, *, online: bool) -> dict[str, Judged]:
    """Scores by class."""
    out: dict[str, Judged] = {kind: {} for kind in NEIGHBOURS}
    for sequence in sequences:
        truth = objects((labels / f"{sequence.name}.txt").read_text(encoding="utf-8"))
        tracked = objects(follow(sequence, None, 0.1, cut, online=online)[0])
        frames = range(max([*truth, *tracked], default=-1) + 1)
        for kind, judged in out.items():
            judged[sequence.name] = [association(kind, truth.get(f, []), tracked.get(f, [])) for f in frames]
    return out


def show(kind: str, what: str, judged: Judged) -> None:
    """Print a line for all, odd and even sequences."""
    for half, rest in (("all", (0, 1)), ("odd", (1,)), ("even", (0,))):
        scores = track_metrics([judged[name] for name in judged if int(name) % 2 in rest])
        figures = "  ".join(f"{name} {100 * scores.get(name, np.nan):5.1f}" for name in FIGURES)
        print(f"{kind:<11}{what:<14}{half:<5}{figures}  switches {scores.get('id_switches', 0):.0f}", flush=True)


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--detections", type=Path, nargs="+", required=True)
    options.add_argument("--labels", type=Path, required=True)
    options.add_argument("--online", action="store_true")
    options.add_argument(
        "--cut", type=lambda text: np.arange(*map(float, text.split(":"))), help="thresholds to choose from"
    )
    arguments = options.parse_args()
    sequences = [s for s in merge([read(files(path)) for path in arguments.detections]) if s.name != TEST]
    for kind, judged in judge(sequences, arguments.labels, None, online=arguments.online).items():
        show(kind, "as written", judged)
    if arguments.cut is None:
        return
    tried = {c: judge(sequences, arguments.labels, float(c), online=arguments.online) for c in arguments.cut}
    for kind in NEIGHBOURS:

        def best(names: Sequence[str], kind: str = kind) -> float:
            return max(tried, key=lambda c: track_metrics([tried[c][kind][n] for n in names]).get("HOTA", 0.0))

        names = [s.name for s in sequences]
        show(kind, f"best cut {best(names):.2f}", tried[best(names)][kind])
        show(kind, "left out", {n: tried[best([m for m in names if m != n])][kind][n] for n in names})


if __name__ == "__main__":
    main()
