"""Objects that a drive's labels leave out, from a table beside them."""

from __future__ import annotations

import csv
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from modt.errors import MisuseError
from modt.geometry import transform_boxes
from modt.types import Float64
from modt_evaluation.kitti_labels import MAX_FRAME, MAX_ID, MAX_NUMBER, Label
from modt_evaluation.truth import FrameTruth, Role, Truth, Types

PARKED = "IgnoredCar"
"""Type of a parked car that is ignored."""
NUMBERS = ("x", "y", "z_bottom", "length", "width", "height", "yaw")
COLUMNS = ("frame", "object", "type", *NUMBERS)
WRITE = "write frame and object as whole numbers, the others in metres and radians, sizes above 0"
HEAD = f"begin with the line {','.join(COLUMNS)}"


def with_further(truth: Truth, path: Path, types: Types) -> Truth:
    """The truth with the objects of a table added; they are judged for their class alone.

    Args:
        truth: truth of the drive that the table completes.
        path: the table (docs/evaluation.md).
        types: class and role of the types of its objects.

    Raises:
        MisuseError: the table is broken or of another drive; it names the line.
    """
    added: dict[int, list[Label]] = defaultdict(list)
    for place, label in _rows(path):
        if label.type_ != PARKED and label.type_ not in types:
            known = ", ".join((*types, PARKED))
            raise MisuseError(place, f"{label.type_!r} is no type of an object", f"write one of {known}")
        if label.frame not in truth.frames:
            cause = f"frame {label.frame} is not in the truth, which has {len(truth.frames)} frames"
            raise MisuseError(place, cause, "give the table of the drive that is judged")
        added[label.frame].append(label)
    frames = {f: _joined(frame, added[f], types) if f in added else frame for f, frame in truth.frames.items()}
    return replace(truth, frames=frames)


def _joined(frame: FrameTruth, labels: list[Label], types: Types) -> FrameTruth:
    objects = [label for label in labels if label.type_ != PARKED]
    added = FrameTruth.of(types, [o.id for o in objects], [o.type_ for o in objects], _boxes(frame, objects))
    parked = _boxes(frame, [label for label in labels if label.type_ == PARKED])
    return replace(
        frame,
        id=np.concatenate([frame.id, added.id]),
        type_=(*frame.type_, *added.type_),
        object_class=np.concatenate([frame.object_class, added.object_class]),
        role=np.concatenate([frame.role, np.where(added.role == Role.COUNTED, Role.FURTHER, added.role)]),
        box=np.concatenate([frame.box, added.box]),
        parked=np.concatenate([frame.parked, parked]),
    )


def _boxes(frame: FrameTruth, labels: list[Label]) -> Float64:
    """(n, 7) boxes of labels in the frame of the truth's boxes."""
    return transform_boxes(frame.T_box_sensor, np.array([label.box for label in labels]).reshape(-1, 7))


def _rows(path: Path) -> Iterator[tuple[str, Label]]:
    """File and line of each row of a table, and its label, whose box is in the sensor frame.

    Raises:
        MisuseError: it cannot be read, is empty, or a line is broken.
    """
    seen: set[tuple[int, int]] = set()
    try:
        with path.open(encoding="utf-8-sig", newline="") as lines:
            table = csv.DictReader(lines)
            missing = [name for name in COLUMNS if name not in (table.fieldnames or ())]
            if missing:
                raise MisuseError(f"{path}:1", f"has no column {', '.join(missing)}", HEAD)
            for fields in table:
                place = f"{path}:{table.line_num}"
                try:
                    label = _label(fields)
                except (ValueError, TypeError, OverflowError):
                    raise MisuseError(place, "no object", WRITE) from None
                if (label.frame, label.id) in seen:
                    cause = f"object {label.id} is in frame {label.frame} twice"
                    raise MisuseError(place, cause, "leave one of the lines out, or give it a number of its own")
                seen.add((label.frame, label.id))
                yield place, label
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise MisuseError(path, f"cannot be read ({error})", "restore the table") from None
    if not seen:
        raise MisuseError(path, "holds no objects", "add them, or leave --further out")


def _label(fields: dict[str, str]) -> Label:
    """The label of a line.

    Raises:
        ValueError, TypeError or OverflowError: it is no label.
    """
    frame = int(fields["frame"])
    number = int(fields["object"])
    values = [float(fields[name]) for name in NUMBERS]
    x, y, foot, length, width, height, yaw = values
    box = np.array([x, y, foot + height / 2, length, width, height, yaw])
    possible = 0 <= frame <= MAX_FRAME and 0 <= number <= MAX_ID and (np.abs(values) <= MAX_NUMBER).all()
    if not possible or min(length, width, height) <= 0:
        raise ValueError(fields)
    return Label(frame, number, fields["type"], box)
