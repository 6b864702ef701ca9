"""The drives that experiments are made on: KITTI's below a folder, and simulated ones."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Protocol

import numpy as np

from modt.errors import MisuseError
from modt.geometry import FieldOfView
from modt.profile import DEFAULT
from modt.types import Frame
from modt_desk.evaluation.rules import CUBOID_RULES, Rules
from modt_desk.evaluation.truth import KITTI_TYPES, FrameTruth, Role, Truth
from modt_desk.evaluation.truth_files import TRACKLETS, open_truth
from modt_desk.simulation.kinds import TRUCK
from modt_desk.simulation.synthetic_stream import SyntheticStream

KITTI, SIMULATED = "KITTI", "simulated"
"""Kinds of drives."""
DRIVE_OF_SEQUENCE = dict(
    enumerate(("0005", "0009", "0011", "0013", "0014", "0015", "0018", "0022", "0032", "0036", "0056", "0059"))
)
"""Raw drive of 2011_09_26 that each of KITTI's first tracking sequences is of."""
HAD_A_SAY = frozenset({"0005"})
"""Drives that choices of this project were confirmed on."""
FIRST_SEED = 7000
"""Of simulated drives; nothing is trained or settled on these."""
SCENES = ("street", "crossing")
SIMULATED_TYPES = {**KITTI_TYPES, TRUCK.name: (KITTI_TYPES["Car"][0], Role.NEUTRAL)}
_NO_LABELS = frozenset({"velodyne_points", "velodyne", "oxts", "image_00", "image_01", "image_02", "image_03"})


class Drive(Protocol):
    """A labelled drive; scans: whether its sweeps are there, too."""

    @property
    def name(self) -> str:
        """Of the drive."""

    @property
    def number(self) -> str:
        """Of the recording, whatever labels it is judged by."""

    @property
    def kind(self) -> str:
        """KITTI or SIMULATED."""

    @property
    def scans(self) -> bool:
        """Whether most of its sweeps are there."""

    @property
    def had_a_say(self) -> bool:
        """Whether choices of this project were confirmed on it."""

    @property
    def sensor(self) -> str:
        """Profile of its sensor."""

    def digest(self) -> str:
        """Of all that is read of it."""

    def labels(self) -> dict[int, FrameTruth]:
        """By frame."""

    def rules(self) -> Rules:
        """By which it is judged."""

    def fov(self) -> FieldOfView:
        """Where it is labelled."""

    def sweeps(self) -> Iterator[tuple[Frame, FrameTruth]]:
        """Its labelled sweeps."""


@dataclass(frozen=True, slots=True)
class KittiDrive:
    """A raw drive with tracklets, or a label file of KITTI tracking.

    Attributes:
        name: number of the raw drive, and the sequence if its labels are those.
        number: of the raw drive, the sequence where it is not known.
        path: of the drive, or the label file.
        scans: whether sweeps of half of the labelled frames or more are there.
    """

    name: str
    number: str
    path: Path
    scans: bool
    kind: str = KITTI
    sensor: str = DEFAULT

    @property
    def had_a_say(self) -> bool:
        """Whether choices were confirmed on it."""
        return self.number in HAD_A_SAY

    def digest(self) -> str:
        """Of the contents of its files."""
        if self.path.is_dir():
            return _digest([*sorted(self.path.parent.glob("calib*.txt")), *_files(self.path)])
        root = self.path.parents[1]
        places = [root / kind / self.path.stem for kind in ("velodyne", "oxts", "calib")]
        beside = [place.with_suffix(".txt") for place in places if place.with_suffix(".txt").is_file()]
        return _digest([self.path, *beside, *(file for place in places for file in _files(place))])

    def labels(self) -> dict[int, FrameTruth]:
        """By frame; vans and sitting people are ignored, as in the paper."""
        return dict(_truth(self.path).frames)

    def rules(self) -> Rules:
        """Labels cover the camera's view."""
        return _truth(self.path).rules

    def fov(self) -> FieldOfView:
        """The camera's."""
        scans = _truth(self.path).scans
        camera = scans.info.camera if scans else None
        return FieldOfView() if camera is None else FieldOfView.of_camera(camera)

    def sweeps(self) -> Iterator[tuple[Frame, FrameTruth]]:
        """Its labelled sweeps."""
        truth = _truth(self.path)
        for frame in truth.scans or ():
            if frame.index in truth.frames:
                yield frame, truth.frames[frame.index]


@dataclass(frozen=True, slots=True)
class SimulatedDrive:
    """A drive through a synthetic scene, labelled all round."""

    scene: str
    seed: int
    seconds: float = 6.0
    sensor: str = DEFAULT
    kind: str = SIMULATED
    scans: bool = True
    had_a_say: bool = False

    @property
    def name(self) -> str:
        """Scene and seed."""
        return f"{self.scene} {self.seed}"

    @property
    def number(self) -> str:
        """The same."""
        return self.name

    def digest(self) -> str:
        """Of its description: the same one gives the same bytes."""
        return f"{self.scene}, {self.sensor}, {self.seconds:g} s, seed {self.seed}"

    def labels(self) -> dict[int, FrameTruth]:
        """By frame."""
        return {frame.index: truth for frame, truth in self.sweeps()}

    def rules(self) -> Rules:
        """Labels all round."""
        return CUBOID_RULES

    def fov(self) -> FieldOfView:
        """The full circle."""
        return FieldOfView()

    def sweeps(self) -> Iterator[tuple[Frame, FrameTruth]]:
        """Every sweep; what has no point in it is not labelled."""
        for frame, truth in SyntheticStream(self.scene, self.sensor, self.seconds, self.seed).sweeps():
            seen = np.flatnonzero(truth.points)
            names = [truth.kinds[k].name for k in seen]
            yield frame, FrameTruth.of(SIMULATED_TYPES, truth.bodies[seen].tolist(), names, truth.boxes[seen])


def kitti_drives(root: Path) -> list[KittiDrive]:
    """The labelled drives below a folder, by name; scans that lie there twice are used once.

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
def _truth(path: Path) -> Truth:
    return open_truth(path, paper=True)


def _digest(files: list[Path]) -> str:
    found = hashlib.blake2b(digest_size=16)
    for file in files:
        found.update(f"{file.name} {file.stat().st_size}\n".encode())
        with file.open("rb") as content:
            while block := content.read(1 << 20):
                found.update(block)
    return found.hexdigest()


def _files(folder: Path) -> list[Path]:
    """Below a folder, images left out."""
    files = (f for f in sorted(folder.rglob("*")) if not any(p.startswith("image_") for p in f.parts))
    return [f for f in files if f.is_file()]
