"""Drives for experiments: KITTI's below a folder, and simulated ones."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from modt.errors import MisuseError
from modt.geometry import FieldOfView
from modt.profile import DEFAULT
from modt.types import Frame, Int
from modt_evaluation.further_objects import with_further
from modt_evaluation.kitti_labels import MAX_ID
from modt_evaluation.rules import CUBOID_RULES, Rules
from modt_evaluation.truth import KITTI_TYPES, PAPER_TYPES, FrameTruth, Role, Truth
from modt_evaluation.truth_files import TRACKLETS, open_truth
from modt_simulation import simulator
from modt_simulation.kinds import TRUCK
from modt_simulation.synthetic_stream import SyntheticStream

KITTI = "KITTI"
"""Kind of a recorded drive."""
SIMULATED = "simulated"
"""Kind of a simulated drive."""
DRIVE_OF_SEQUENCE = dict(
    enumerate(("0005", "0009", "0011", "0013", "0014", "0015", "0018", "0022", "0032", "0036", "0056", "0059"))
)
"""Number of the raw drive of 2011_09_26 from which each of KITTI's first tracking sequences comes."""
DEVELOPMENT_DRIVES = frozenset({"0005"})
"""Drives on which choices of this project were confirmed."""
FIRST_SEED = 7000
"""First seed of the simulated drives; nothing is trained or chosen on these."""
SCENES = ("street", "crossing")
_FURTHER = MAX_ID + 1
"""Added to the numbers of further objects, which may equal those of labels."""
SIMULATED_TYPES = {**KITTI_TYPES, TRUCK.name: (KITTI_TYPES["Car"][0], Role.NEUTRAL)}
_NO_LABELS = frozenset({"velodyne_points", "velodyne", "oxts", "image_00", "image_01", "image_02", "image_03"})


@dataclass(frozen=True)
class KittiDrive:
    """A raw drive with tracklets, or a label file of KITTI tracking.

    Attributes:
        name: number of the raw drive, and the sequence if its labels are those.
        number: number of the raw drive, or the sequence if it is not known.
        path: folder of the drive, or the label file.
        scans: whether sweeps of half of the labelled frames or more are present.
        further: table of objects that its labels leave out, None for the labels alone.
    """

    name: str
    number: str
    path: Path
    scans: bool
    further: Path | None = None
    kind: str = KITTI
    sensor: str = DEFAULT

    @property
    def development(self) -> bool:
        """Whether choices of this project were confirmed on it."""
        return self.number in DEVELOPMENT_DRIVES

    def labels(self) -> dict[int, FrameTruth]:
        """Labels by frame; vans and sitting people are ignored, as in the paper."""
        return dict(_truth(self.path, self.further).frames)

    def rules(self) -> Rules:
        """Rules for labels that cover the camera's view."""
        return _truth(self.path).rules

    def fov(self) -> FieldOfView:
        """The camera's field of view."""
        scans = _truth(self.path).scans
        camera = scans.info.camera if scans else None
        return FieldOfView() if camera is None else FieldOfView.of_camera(camera)

    def sweeps(self) -> Iterator[tuple[Frame, FrameTruth]]:
        """Labelled sweeps with their labels."""
        truth = _truth(self.path, self.further)
        for frame in truth.scans or ():
            if frame.index in truth.frames:
                yield frame, truth.frames[frame.index]


@dataclass(frozen=True)
class SimulatedDrive:
    """A drive through a synthetic scene, labelled all round."""

    scene: str
    seed: int
    seconds: float = 6.0
    sensor: str = DEFAULT
    kind: str = SIMULATED
    scans: bool = True
    development: bool = False

    @property
    def name(self) -> str:
        """Scene and seed."""
        return f"{self.scene} {self.seed}"

    def labels(self) -> dict[int, FrameTruth]:
        """Labels by frame."""
        return {frame.index: truth for frame, truth in self.sweeps()}

    def rules(self) -> Rules:
        """Rules for labels all round."""
        return CUBOID_RULES

    def fov(self) -> FieldOfView:
        """The full circle."""
        return FieldOfView()

    def sweeps(self) -> Iterator[tuple[Frame, FrameTruth]]:
        """Every sweep with its labels; a body without a point has none."""
        for frame, truth in SyntheticStream(self.scene, self.sensor, self.seconds, self.seed).sweeps():
            yield frame, simulated_truth(truth, np.flatnonzero(truth.points))


def simulated_truth(truth: simulator.Truth, which: Int | slice = slice(None)) -> FrameTruth:
    """The labels of some bodies of a simulated sweep, upright in the world."""
    rows = np.arange(len(truth.kinds))[which].tolist()
    names = [truth.kinds[k].name for k in rows]
    boxes = truth.world_boxes[which]
    bodies = truth.bodies[which].tolist()
    return FrameTruth.of(SIMULATED_TYPES, bodies, names, boxes, T_box_sensor=truth.T_world_sensor)


Drive = KittiDrive | SimulatedDrive


def kitti_drives(root: Path) -> list[KittiDrive]:
    """The labelled drives below a folder, by name. Scans that are there twice are used once.

    Raises:
        MisuseError: there are none, or labels that are broken.
    """
    drives = [_drive(path) for path in sorted(_labels_below(root))]
    if not drives:
        remedy = f"give a folder that holds raw drives with {TRACKLETS}, or label_02/ of KITTI tracking"
        raise MisuseError(root, "no labelled KITTI drives", remedy)
    raw = {drive.number for drive in drives if drive.scans and drive.path.is_dir()}
    return sorted(
        (replace(d, scans=d.scans and (d.path.is_dir() or d.number not in raw)) for d in drives),
        key=lambda drive: drive.name,
    )


def completed(drives: Sequence[KittiDrive], further: Path) -> KittiDrive:
    """The drive whose sweeps are present, with the objects of a table that its labels leave out.

    Raises:
        MisuseError: there is not one such drive, or the table is broken or of another drive.
    """
    swept = [drive for drive in drives if drive.scans]
    if len(swept) != 1:
        cause = f"is the table of one drive, and {len(swept)} have their sweeps"
        raise MisuseError("--further", cause, "give a folder with the sweeps of that drive alone")
    (drive,) = swept
    complete = replace(drive, name=f"{drive.name}, complete", further=further)
    complete.labels()  # refuses a table that is broken or of another drive
    return complete


def simulated_drives(n: int, seconds: float) -> list[SimulatedDrive]:
    """Scenes in turn, a seed each."""
    return [SimulatedDrive(SCENES[k % len(SCENES)], FIRST_SEED + k, seconds) for k in range(n)]


def _labels_below(root: Path) -> Iterator[Path]:
    """Raw drives with tracklets, and label files of KITTI tracking with their calibration."""
    seen: set[str] = set()
    for place, folders, files in os.walk(root, followlinks=True):
        path = Path(place)
        new = {name: os.path.realpath(path / name) for name in folders if name not in _NO_LABELS}
        folders[:] = sorted(name for name, real in new.items() if real not in seen)
        seen.update(new.values())
        if TRACKLETS in files:
            yield path
        if path.name == "label_02":
            labelled = (path / file for file in files if file.endswith(".txt"))
            yield from (file for file in labelled if (path.parent / "calib" / file.name).is_file())


def _drive(path: Path) -> KittiDrive:
    truth = _truth(path)
    scans = truth.scans is not None and 2 * len(truth.scans.scans) >= len(truth.frames)
    if path.is_dir():
        found = re.fullmatch(r"(\d{4}_\d\d_\d\d)_drive_(\d{4})_sync", path.name)
        number = found[2] if found and found[1] == "2011_09_26" else path.name
        return KittiDrive(number, number, path, scans)
    sequence = f"tracking {path.stem}"
    number = DRIVE_OF_SEQUENCE.get(int(path.stem)) if path.stem.isdigit() else None
    return KittiDrive(f"{number}, {sequence}" if number else sequence, number or sequence, path, scans)


@cache
def _truth(path: Path, further: Path | None = None) -> Truth:
    truth = open_truth(path, paper=True)
    if further is None:
        return truth
    truth = with_further(truth, further, PAPER_TYPES)
    frames = {
        number: replace(frame, id=np.where(frame.role == Role.FURTHER, frame.id + _FURTHER, frame.id))
        for number, frame in truth.frames.items()
    }
    return replace(truth, frames=frames)
