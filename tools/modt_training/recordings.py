"""Labelled recordings of one's own as crops."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from modt.classes import CLASS_NAMES, CLASSES, N_CLASSES, N_SHIPPED
from modt.config import ProfileConfig
from modt.errors import MisuseError
from modt.geometry import FieldOfView, inverse, transform_boxes
from modt.placement import Mount
from modt.sources.scan_file import ScanStream
from modt.types import Float32
from modt_evaluation import overlap
from modt_evaluation.truth import FrameTruth, Role, Truth
from modt_evaluation.truth_files import labels_beside, open_truth
from modt_training.crop_writer import CropWriter, add_labelled
from modt_training.dataset import Dataset
from modt_training.scan import Scan, on_bottom

SWEEPS = 60
"""Greatest number of sweeps of a recording, evenly spaced: neighbouring ones show the same."""

Progress = Callable[[str], None]
"""Called after every piece of work with a few words."""


@dataclass(frozen=True)
class Recording:
    """A labelled recording."""

    path: Path
    truth: Truth
    scans: ScanStream


def open_recordings(paths: Sequence[Path], labels: Sequence[Path]) -> list[Recording]:
    """Recordings with their labels, those beside them where none are given.

    Raises:
        MisuseError: fewer than two recordings, no labels, not one label file for each recording, or no sweeps.
    """
    if len({path.resolve() for path in paths}) < 2:
        remedy = "give two recordings or more: one is left out to judge by what was learnt from the others"
        raise MisuseError(paths[0], "is one recording, which makes no fold", remedy)
    if labels and len(labels) != len(paths):
        raise MisuseError(
            "--labels", f"{len(labels)} for {len(paths)} recordings", "give one for each, in their order"
        )
    found = []
    for number, path in enumerate(paths):
        place = labels[number] if labels else labels_beside(path)
        if place is None:
            raise MisuseError(path, "has no labels beside it", "give --labels, as for modt evaluate")
        truth = open_truth(place, path)
        if truth.scans is None:
            raise MisuseError(path, "its sweeps are not found", "give a recording that modt replay reads")
        found.append(Recording(path, truth, truth.scans))
    return found


def scans_of(recording: Recording, number: int, sensor: str, config: ProfileConfig) -> Iterator[Scan]:
    """Evenly spaced labelled sweeps of a recording."""
    truth = recording.truth
    labelled = [scan for scan in recording.scans.scans if scan.index in truth.frames]
    chosen = labelled[:: -(-len(labelled) // SWEEPS) or 1]
    mount = Mount.of(config.sensor.roll_deg, config.sensor.pitch_deg)
    fov = _sector(truth.rules.sector_deg)
    drive = f"{number}: {recording.path.name}"
    for frame in ScanStream(recording.scans.info, chosen):
        yield labelled_scan(
            f"{drive}/{frame.index}", drive, frame.points, truth.frames[frame.index], fov, sensor, config, mount
        )


def labelled_scan(
    name: str,
    drive: str,
    points: Float32,
    truth: FrameTruth,
    fov: FieldOfView,
    sensor: str,
    config: ProfileConfig,
    mount: Mount,
) -> Scan:
    """A sweep (N, 4) with the points of its objects. Those of a type between the classes count as unlabelled.

    The points of the scan are turned level by `mount`, the boxes stay in the frame of the tilted sensor: of boxes of
    recordings only the height is used.
    """
    members = overlap.ObjectPoints.of(points, truth).clear
    counted = truth.role == Role.COUNTED
    boxes = on_bottom(transform_boxes(inverse(truth.T_box_sensor), truth.box))
    unlabelled = np.zeros(len(points), np.bool_)
    for k in np.flatnonzero(~counted).tolist():
        unlabelled[members[k]] = True
    for box in truth.parked:
        unlabelled |= overlap.inside(overlap.in_box_frame(points, truth), box)
    if truth.regions is not None:
        unlabelled |= truth.regions.contains(points)
    level = mount.turn(points)
    unlabelled |= fov.depth(level) <= 0
    objects = tuple(members[k] for k in np.flatnonzero(counted).tolist())
    kinds = tuple(truth.object_class[counted].tolist())
    return Scan(name, drive, level, objects, kinds, boxes[counted], fov, unlabelled, sensor, config)


def _sector(half_deg: float) -> FieldOfView:
    """The view of a sector about x."""
    if half_deg >= 180:
        return FieldOfView()
    half = np.deg2rad(half_deg)
    edges = [[np.sin(half), side * np.cos(half), 0.0, 0.0] for side in (-1, 1)]
    return FieldOfView(np.array(edges))


def write_crops(
    path: Path, recordings: Sequence[Recording], sensor: str, config: ProfileConfig, progress: Progress
) -> None:
    """Write the crops of recordings."""
    writer = CropWriter()
    for number, recording in enumerate(recordings):
        for scan in scans_of(recording, number, sensor, config):
            add_labelled(writer, scan)
        progress(recording.path.name)
    writer.save(path, {"recordings": [recording.path.name for recording in recordings]})


def check_examples(data: Dataset) -> None:
    """Raise a MisuseError where crops are too few.

    Every class of the user's own needs examples in two recordings, and some object must be there at all.
    """
    whole = data.trainable & (data.label > 0)
    if not whole.any():
        raise MisuseError("labels", "no object of a class is seen whole", "give recordings with labelled objects")
    for c in range(N_SHIPPED, N_CLASSES):
        drives = len(np.unique(data.drive[whole & (data.label == c)]))
        if drives < 2:
            names = ", ".join(CLASSES[c].kitti)
            cause = f"has examples in {drives} of the recordings"
            remedy = f"label it in two or more; its label is one of: {names}"
            raise MisuseError(f"class {CLASS_NAMES[c]}", cause, remedy)
