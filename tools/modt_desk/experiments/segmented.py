"""A drive once it is segmented: what all settings of a sweep have in common.

Of the points of a sweep only those are kept that are in a proposal, or in the box of a labelled object: neither stage
nor judgement looks at the others.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modt.app import assembly, kernel_choice
from modt.config import ProfileConfig
from modt.geometry import Camera, FieldOfView
from modt.profile import dump
from modt.types import Bool, Float32, Frame, Proposals
from modt_desk.evaluation.overlap import PAD_M, ObjectPoints, in_box_frame, inside
from modt_desk.evaluation.rules import Rules
from modt_desk.evaluation.truth import FrameTruth, Regions
from modt_desk.experiments.drives import Drive
from modt_desk.experiments.store import Arrays, Store, key_of

_WIDE = {"members": np.int64, "offsets": np.int64}
"""Columns of proposals that are stored in four bytes."""
_COMPUTED = "coordinates"
_last: dict[str, SegmentedDrive] = {}
"""The drive used last, by its key: the settings of a sweep follow one another."""
_lock = Lock()


@dataclass(frozen=True, slots=True)
class SegmentedFrame:
    """A sweep: the points that matter, its proposals, what is true of it, and the points of what is there."""

    frame: Frame
    proposals: Proposals
    truth: FrameTruth
    objects: ObjectPoints


@dataclass(frozen=True, slots=True)
class SegmentedDrive:
    """All sweeps of a drive.

    Attributes:
        key: hash of what they follow from.
        frames: in order.
        fov: that was segmented.
        rules: by which they are judged.
    """

    key: str
    frames: tuple[SegmentedFrame, ...]
    fov: FieldOfView
    rules: Rules


def segmented(drive: Drive, digest: str, config: ProfileConfig, store: Store) -> SegmentedDrive:
    """The drive, of this digest, segmented as configured; from the store where it was before."""
    described = dump(config)
    key = key_of("segmented", digest, described["sensor"], described["segmentation"])
    with _lock:
        if key not in _last:
            arrays = store.made(key, lambda: dict(_packed(_segment(drive, config))))
            _last.clear()
            _last[key] = SegmentedDrive(key, tuple(_unpacked(arrays)), drive.fov(), drive.rules())
        return _last[key]


def _segment(drive: Drive, config: ProfileConfig) -> Iterator[tuple[Frame, Proposals, FrameTruth]]:
    segmenter = assembly.segmenter(config, drive.fov(), kernel_choice.choose(config.segmentation.kernels))
    for frame, truth in drive.sweeps():
        proposals = segmenter.segment(frame.points)
        kept = _of_objects(frame.points, truth)
        kept[proposals.members] = True
        row = np.cumsum(kept) - 1
        points = frame.points[kept]
        few = Frame(frame.index, frame.stamp_s, points, frame.T_world_sensor, frame.restarts, frame.turn_s)
        columns = {f.name: getattr(proposals, f.name) for f in fields(proposals)}
        yield few, Proposals(**columns | {"members": row[proposals.members]}), truth


def _of_objects(points: Float32, truth: FrameTruth) -> Bool:
    """(N,) points in or near the box of a labelled object."""
    kept, moved = np.zeros(len(points), np.bool_), in_box_frame(points, truth)
    for box in truth.box:
        kept |= inside(moved, box, pad_m=2 * PAD_M, foot_m=-2 * PAD_M)
    return kept


def _packed(frames: Iterator[tuple[Frame, Proposals, FrameTruth]]) -> Iterator[tuple[str, NDArray[Any]]]:
    for k, (frame, proposals, truth) in enumerate(frames):
        yield f"{k} time", np.array([frame.index, frame.stamp_s, frame.restarts, frame.turn_s])
        yield f"{k} points", frame.points
        if frame.T_world_sensor is not None:
            yield f"{k} pose", frame.T_world_sensor
        for f in fields(proposals):
            column = getattr(proposals, f.name)
            if column is not None and f.name != _COMPUTED:
                yield f"{k} proposals {f.name}", column.astype(np.int32) if f.name in _WIDE else column
        for f in fields(truth):
            if f.name != "regions":
                yield f"{k} truth {f.name}", np.asarray(getattr(truth, f.name))
        if truth.regions is not None:
            camera = truth.regions.camera
            yield f"{k} regions", truth.regions.edges
            yield "camera P", camera.P_image_sensor
            yield "camera T", camera.T_camera_sensor
            yield "camera size", np.array([camera.width_px, camera.height_px])


def _unpacked(arrays: Arrays) -> Iterator[SegmentedFrame]:
    n = sum(name.endswith(" time") for name in arrays)
    proposal_columns = [f.name for f in fields(Proposals) if f.name != _COMPUTED]
    truth_columns = [f.name for f in fields(FrameTruth) if f.name != "regions"]
    for k in range(n):
        index, stamp_s, restarts, turn_s = arrays[f"{k} time"].tolist()
        points = arrays[f"{k} points"]
        frame = Frame(int(index), stamp_s, points, arrays.get(f"{k} pose"), int(restarts), turn_s)
        found = {name: arrays.get(f"{k} proposals {name}") for name in proposal_columns}
        columns: dict[str, Any] = {
            name: column if column is None else column.astype(_WIDE.get(name, column.dtype))
            for name, column in found.items()
        }
        columns[_COMPUTED] = np.ascontiguousarray(points[columns["members"], :3].T)
        labels: dict[str, Any] = {name: arrays[f"{k} truth {name}"] for name in truth_columns}
        labels["type_"] = tuple(labels["type_"].tolist())
        if f"{k} regions" in arrays:
            camera = Camera(arrays["camera P"], arrays["camera T"], *arrays["camera size"].tolist())
            labels["regions"] = Regions(arrays[f"{k} regions"], camera)
        truth = FrameTruth(**labels)
        yield SegmentedFrame(frame, Proposals(**columns), truth, ObjectPoints.of(points, truth))
