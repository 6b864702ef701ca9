"""Detections that somebody else has made, one file a sequence.

Two formats are recognised: AB3DMOT's 15 comma-separated columns (frame; type 1 Pedestrian, 2 Car, 3 Cyclist; left,
top, right, bottom [pixel]; score; h, w, l, x, y, z [m], ry [rad]; alpha) and KITTI's tracking labels (frame, id,
type, truncated, occluded, alpha, box, h, w, l, x, y, z, ry and a score; what has none is sure). Both are in the
coordinates of the camera: x right, y down, z forward, the place being the middle of the foot. Scores are on the scale
of PointRCNN's; where all of a detector's lie between 0 and 1 they are probabilities, and taken there.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from modt.errors import MisuseError
from modt.geometry import wrap
from modt.types import Bool, Float64, Int

TYPES = ("Pedestrian", "Car", "Cyclist")
"""In AB3DMOT's order, which counts from 1."""
COLUMNS = 15
UNSCORED = 10.0
"""Score of what has none: somebody is sure of it."""
EVEN = 5.0
"""PointRCNN's score of cars at 20 m of which every other is one."""
LEAST_DOUBT = 1e-3
"""No probability is nearer to 0 or 1."""
T_LEVEL_CAMERA = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
"""Camera coordinates to x forward, y left, z up."""


@dataclass(frozen=True, slots=True)
class Detections:
    """The detections of a sequence; D rows in the order of their frames.

    Attributes:
        name: of the sequence.
        frame: (D,) index of the frame.
        type_: (D,) index in TYPES.
        image_box: (D, 4) left, top, right, bottom [pixel].
        score: (D,) the higher the surer.
        box: (D, 7) x, y, z of the centre, l, w, h [m], yaw [rad]; x forward, y left, z up from the camera.
    """

    name: str
    frame: Int
    type_: Int
    image_box: Float64
    score: Float64
    box: Float64

    def __len__(self) -> int:
        return len(self.frame)

    @property
    def n_frames(self) -> int:
        """Frames up to the last one with a detection."""
        return int(self.frame[-1]) + 1 if len(self) else 0

    def take(self, rows: Bool | Int) -> Detections:
        """Some of them."""
        return Detections(
            self.name, self.frame[rows], self.type_[rows], self.image_box[rows], self.score[rows], self.box[rows]
        )

    def frames(self) -> Iterator[tuple[int, slice]]:
        """Every frame from 0 on, those without a detection too, and its rows."""
        ends = np.searchsorted(self.frame, np.arange(self.n_frames + 1))
        return ((i, slice(int(ends[i]), int(ends[i + 1]))) for i in range(self.n_frames))


def files(path: Path) -> list[Path]:
    """The sequences of a folder, or the one file.

    Raises:
        MisuseError: there are none.
    """
    found = sorted(path.glob("*.txt")) if path.is_dir() else [path]
    if not found:
        raise MisuseError(path, "no .txt files", "give a file of detections, or a folder of them")
    return found


def read(paths: Sequence[Path]) -> list[Detections]:
    """The detections of files that are one detector's: whether its scores are probabilities, all of them tell.

    Raises:
        MisuseError: one cannot be read, or a line is of neither format; it names the line.
    """
    tables = [_table(path) for path in paths]
    score = np.concatenate([table[:, 6] for table in tables])
    probable = bool(((score >= 0) & (score <= 1)).all())
    return [
        Detections(
            name=path.stem,
            frame=table[:, 0].astype(np.int64),
            type_=table[:, 1].astype(np.int64) - 1,
            image_box=table[:, 2:6],
            score=_log_odds(table[:, 6]) if probable else table[:, 6],
            box=level(table[:, 7:14]),
        )
        for path, table in zip(paths, tables, strict=True)
    ]


def _table(path: Path) -> Float64:
    """(n, 15) AB3DMOT's columns of a file, in the order of their frames."""
    try:
        lines = path.read_text(encoding="ascii").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise MisuseError(path, f"cannot be read ({error})", "give a text file of detections") from None
    rows = [_row(line, f"{path}:{number}") for number, line in enumerate(lines, 1) if line.strip()]
    table = np.array([r for r in rows if r is not None]).reshape(-1, COLUMNS)
    return table[np.argsort(table[:, 0], kind="stable")]


def _log_odds(probability: Float64) -> Float64:
    """(n,) probabilities as log odds about EVEN."""
    p = np.clip(probability, LEAST_DOUBT, 1 - LEAST_DOUBT)
    log_odds: Float64 = EVEN + np.log(p / (1 - p))
    return log_odds


def level(hwlxyzry: Float64) -> Float64:
    """(n, 7) boxes x, y, z, l, w, h, yaw (x forward, y left, z up) of KITTI's h, w, l, x, y, z, ry."""
    h, w, l, x, y, z, ry = hwlxyzry.T  # noqa: E741
    return np.stack([z, -x, h / 2 - y, l, w, h, wrap(-ry - np.pi / 2)], axis=1)


def kitti(boxes: Float64) -> Float64:
    """(n, 7) KITTI's h, w, l, x, y, z, ry of boxes x, y, z, l, w, h, yaw: undoes level."""
    x, y, z, l, w, h, yaw = boxes.T  # noqa: E741
    return np.stack([h, w, l, -y, h / 2 - z, x, wrap(-yaw - np.pi / 2)], axis=1)


def _row(line: str, place: str) -> list[float] | None:
    """AB3DMOT's columns of a line, None for a type that is not followed."""
    try:
        numbers = [float(v) for v in line.split(",")] if "," in line else _label(line.split())
    except (ValueError, IndexError):
        raise MisuseError(place, "no detection", "write 15 comma-separated columns or a KITTI label") from None
    if numbers is None:
        return None
    if len(numbers) != COLUMNS or not np.isfinite(numbers).all() or numbers[0] < 0:
        raise MisuseError(place, f"{len(numbers)} columns of finite numbers expected, {COLUMNS} in all", "mend it")
    return numbers if numbers[1] in (1, 2, 3) else None


def _label(words: list[str]) -> list[float] | None:
    """AB3DMOT's columns of a KITTI label's words."""
    if words[2] not in TYPES:
        return None
    alpha, *box = (float(v) for v in words[5:17])
    if len(box) != 11:
        raise ValueError(words)
    score = float(words[17]) if len(words) > 17 else UNSCORED
    return [float(words[0]), TYPES.index(words[2]) + 1.0, *box[:4], score, *box[4:], alpha]
