"""Boxes of another detector, one file a sequence.

Two formats are recognised: AB3DMOT's 15 comma-separated columns (frame; type; left, top, right, bottom [pixel];
score; h, w, l, x, y, z [m], ry [rad]; alpha) and KITTI's tracking labels (frame, id, type, truncated, occluded,
alpha, image box, h, w, l, x, y, z, ry, optional score). Coordinates are the camera's: x right, y down, z forward,
position of a box in the middle of its bottom face. Scores are on the scale of PointRCNN; where all scores of a
detector lie between 0 and 1 they are probabilities and are converted to that scale.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from itertools import chain
from pathlib import Path

import numpy as np

from modt.classes import CLASSES, ObjectClass
from modt.errors import MisuseError
from modt.geometry import wrap
from modt.sources.file_names import files_in
from modt.sources.text_file import read_lines
from modt.types import Bool, Float64, Int
from modt_evaluation.kitti_labels import MAX_FRAME

DETECTED = (ObjectClass.PEDESTRIAN, ObjectClass.CAR, ObjectClass.CYCLIST)
"""Classes in the order of AB3DMOT's types, which count from 1."""
N_COLUMNS = 15
DEFAULT_SCORE = 10.0
"""Score of a label without one, which counts as certain."""
LOGIT_OFFSET = 5.0
"""PointRCNN's score of cars at 20 m at which half of them are true."""
MIN_PROBABILITY = 1e-3
"""Probabilities are clipped to this distance from 0 and 1."""
T_LEVEL_CAMERA = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
"""Camera axes to the level frame: x forward, y left, z up, origin in the camera."""


@dataclass(frozen=True)
class Detections:
    """The D detections of a sequence, ordered by frame."""

    name: str  # name of the sequence
    frame: Int  # (D,) index of the frame
    object_class: Int  # (D,) class
    image_box: Float64  # (D, 4) left, top, right, bottom [pixel]
    score: Float64  # (D,) increasing with confidence
    box: Float64  # (D, 7) x, y, z of the centre, l, w, h [m], yaw [rad], level frame of the camera

    def __len__(self) -> int:
        return len(self.frame)

    @property
    def n_frames(self) -> int:
        """Number of frames up to the last detection."""
        return int(self.frame[-1]) + 1 if len(self) else 0

    def take(self, rows: Bool | Int) -> Detections:
        """The detections at some rows."""
        return Detections(self.name, *(getattr(self, f.name)[rows] for f in fields(self)[1:]))

    def frames(self) -> Iterator[tuple[int, slice]]:
        """Every frame from 0, empty ones included, and its rows."""
        ends = np.searchsorted(self.frame, np.arange(self.n_frames + 1))
        return ((i, slice(int(ends[i]), int(ends[i + 1]))) for i in range(self.n_frames))


def files(path: Path) -> list[Path]:
    """The .txt files of a folder, or the one file.

    Raises:
        MisuseError: the folder has none.
    """
    found = files_in(path, ".txt") if path.is_dir() else [path]
    if not found:
        raise MisuseError(path, "no .txt files", "give a file of detections, or a folder of them")
    return found


def read(paths: Sequence[Path]) -> list[Detections]:
    """Detections of all files of one detector; together they show whether its scores are probabilities.

    Raises:
        MisuseError: a file is unreadable, or a line has neither format; the error names it.
    """
    tables = [_table(path) for path in paths]
    score = np.concatenate([table[:, 6] for table in tables])
    probabilities = bool(((score >= 0) & (score <= 1)).all())
    return [
        Detections(
            name=path.stem,
            frame=table[:, 0].astype(np.int64),
            object_class=np.array(DETECTED)[table[:, 1].astype(np.int64) - 1],
            image_box=table[:, 2:6],
            score=_log_odds(table[:, 6]) if probabilities else table[:, 6],
            box=boxes_from_kitti(table[:, 7:14]),
        )
        for path, table in zip(paths, tables, strict=True)
    ]


def merge(detectors: Iterable[Iterable[Detections]]) -> list[Detections]:
    """The sequences of all detectors, ordered by name. Those of one name are merged."""
    named: dict[str, list[Detections]] = {}
    for sequence in chain.from_iterable(detectors):
        named.setdefault(sequence.name, []).append(sequence)
    return [_merged(name, named[name]) for name in sorted(named)]


def _merged(name: str, parts: list[Detections]) -> Detections:
    columns = (np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(Detections)[1:])
    whole = Detections(name, *columns)
    return whole.take(np.argsort(whole.frame, kind="stable"))


def _table(path: Path) -> Float64:
    """(n, 15) AB3DMOT columns of a file, ordered by frame."""
    lines = read_lines(path, "give a text file of detections")
    rows = [_row(line, f"{path}:{number}") for number, line in enumerate(lines, 1) if line.strip()]
    table = np.array([r for r in rows if r is not None]).reshape(-1, N_COLUMNS)
    return table[np.argsort(table[:, 0], kind="stable")]


def _log_odds(probability: Float64) -> Float64:
    """(n,) log odds of probabilities, plus LOGIT_OFFSET."""
    p = np.clip(probability, MIN_PROBABILITY, 1 - MIN_PROBABILITY)
    return np.asarray(LOGIT_OFFSET + np.log(p / (1 - p)))


def boxes_from_kitti(hwlxyzry: Float64) -> Float64:
    """(n, 7) x, y, z, l, w, h, yaw in the level frame of h, w, l, x, y, z, ry (n, 7) in the camera frame."""
    h, w, l, x, y, z, ry = hwlxyzry.T  # noqa: E741
    return np.stack([z, -x, h / 2 - y, l, w, h, wrap(-ry - np.pi / 2)], axis=1)


def boxes_to_kitti(boxes: Float64) -> Float64:
    """(n, 7) h, w, l, x, y, z, ry in the camera frame: the inverse of boxes_from_kitti."""
    x, y, z, l, w, h, yaw = boxes.T  # noqa: E741
    return np.stack([h, w, l, -y, h / 2 - z, x, wrap(-yaw - np.pi / 2)], axis=1)


def _row(line: str, location: str) -> list[float] | None:
    """AB3DMOT columns of a line, None for other types."""
    try:
        numbers = [float(v) for v in line.split(",")] if "," in line else _label(line.split())
    except (ValueError, IndexError):
        raise MisuseError(location, "is no detection", "write 15 comma-separated columns or a KITTI label") from None
    if numbers is None:
        return None
    if len(numbers) != N_COLUMNS or not np.isfinite(numbers).all() or not 0 <= numbers[0] <= MAX_FRAME:
        raise MisuseError(location, f"has not {N_COLUMNS} finite numbers, or no possible frame", "correct the line")
    return numbers if numbers[1] in range(1, len(DETECTED) + 1) else None


def _label(fields: list[str]) -> list[float] | None:
    """AB3DMOT columns of the fields of a KITTI label."""
    types = [CLASSES[c].kitti[0] for c in DETECTED]
    if fields[2] not in types:
        return None
    alpha, *box = (float(v) for v in fields[5:17])
    if len(box) != 11:
        raise ValueError(fields)
    score = float(fields[17]) if len(fields) > 17 else DEFAULT_SCORE
    return [float(fields[0]), types.index(fields[2]) + 1.0, *box[:4], score, *box[4:], alpha]


def box_lines(
    frame: Int, kitti_type: Sequence[str], ids: Int, image_box: Float64, hwlxyzry: Float64, score: Float64
) -> list[str]:
    """Lines of KITTI's tracking format with a score, for n boxes of another detector.

    Image boxes (n, 4) are left, top, right, bottom [pixel]; boxes (n, 7) h, w, l, x, y, z [m], ry [rad] in camera
    coordinates.
    """
    alpha = wrap(hwlxyzry[:, 6] - np.arctan2(hwlxyzry[:, 3], hwlxyzry[:, 5]))
    columns = (frame, ids, alpha, image_box, hwlxyzry, score)
    return [
        f"{f} {i} {kind} 0 0 {a:.4f} {b[0]:.2f} {b[1]:.2f} {b[2]:.2f} {b[3]:.2f} "
        f"{d[0]:.4f} {d[1]:.4f} {d[2]:.4f} {d[3]:.4f} {d[4]:.4f} {d[5]:.4f} {d[6]:.4f} {s:.4f}\n"
        for kind, f, i, a, b, d, s in zip(kitti_type, *(column.tolist() for column in columns), strict=True)
    ]
