"""Data sets of crops: proposals of the segmentation, labelled by overlap with objects.

A proposal takes the class of an object if they share more than half of the points of each. Fragments and merged
objects are marked partial, proposals outside the annotated regions unknown. Neither is used for training; unknown
ones are not validated either. Every scan is segmented by the profile of its sensor; KITTI's are thinned to 32 and to
16 beams too. A file contains its provenance. Simulated sweeps are seen by every simulated sensor in turn.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import chain, cycle
from pathlib import Path

import numpy as np

from modt.config import ProfileConfig
from modt_simulation.sensors import SENSORS
from modt_training.crop_writer import CropWriter, add_labelled
from modt_training.dataset import CLUSTERED, PASTED, SYNTHETIC
from modt_training.scan import Scan
from modt_training.simulated import simulated_scans
from tools.train.bare_scans import bare_scans
from tools.train.labelled_scans import (
    THINNED,
    argoverse_scans,
    folder_scans,
    object_scans,
    pandaset_scans,
    semantic_scans,
    thinned,
)
from tools.train.near_scans import near_scans
from tools.train.paste import cut_objects, paste_objects
from tools.train.people_scans import low_people_scans, people_scans
from tools.train.rider_scans import rider_scans
from tools.train.synthetic_scans import label_files, scans_from_labels
from tools.train.worn_scans import worn_scans

SYNTHETIC_CELL_SCALES = (0.75, 1.0, 1.0, 1.4)
"""Cell sizes of simulated sweeps, in turn, relative to the profile's."""
SCENES = ("street", "crossing")
TIMES_S = (0.0, 2.5)
PASTES = 120
"""Pasting attempts in each scan of KITTI."""
MIN_HOST_POINTS = 60_000
"""Objects are pasted into scans of more points."""
SIMULATED: Mapping[str, Callable[..., Iterator[Scan]]] = {
    "near": near_scans,
    "bare": bare_scans,
    "people": people_scans,
    "low": low_people_scans,
    "riders": rider_scans,
    "worn": worn_scans,
}
"""Sweeps of the kinds of worlds, by seeds."""
FEW_BEAMS = ("vlp-16", "vlp-16", "mid-360")
FEW_POINTS = ("mid-360", "mid-360", "vlp-16")
OF_ROBOTS = (*FEW_BEAMS, "os1-64")
"""Sensors of few beams, of few points a sweep, and of small robots, in turn."""
SEEDS_APART = 100_000
"""Number of worlds between the first ones of two seeds."""


def kitti(root: Path) -> Iterator[Scan]:
    """Labelled scans of KITTI's object frames; none is of a test drive."""
    for folder in ("training", "training_more"):
        yield from object_scans(root / "object" / folder)


def kitti_crops(path: Path, root: Path) -> None:
    """Write crops of real scans, and of scans of KITTI with pasted objects.

    Args:
        path: file to write (.npz).
        root: KITTI's root, with argoverse2/ and pandaset/ beside object/.
    """
    writer = CropWriter()
    scans = list(kitti(root))
    for scan in scans:
        add_labelled(writer, scan)
        for step in THINNED:
            add_labelled(writer, thinned(scan, step))
    for scan in semantic_scans(root / "odometry"):
        writer.add(scan, CLUSTERED)
    for scan in (*argoverse_scans(root / "argoverse2"), *pandaset_scans(root / "pandaset")):
        add_labelled(writer, scan)
    cuts = cut_objects(scans)
    rng = np.random.default_rng(0)
    for scan in scans:
        if len(scan.points) > MIN_HOST_POINTS:
            for made in paste_objects(scan, cuts, PASTES, rng):
                writer.add(made, PASTED)
    print(writer.save(path, {"paste": PASTES, "seed": 0}), flush=True)


def own_crops(path: Path, folder: Path, config: ProfileConfig, sensor: str) -> None:
    """Write crops of one's own labelled scans, as labelled_scans.folder_scans reads them."""
    writer = CropWriter()
    for scan in folder_scans(folder, sensor, config):
        add_labelled(writer, scan)
    print(writer.save(path, {"paste": 0, "seed": 0}), flush=True)


def synthetic_crops(path: Path, worlds: int, labels: Path | None = None) -> None:
    """Write crops of simulated streets and crossings.

    Args:
        path: file to write (.npz).
        worlds: number of the streets and crossings.
        labels: folder with label_2/ and frame_to_raw.tsv; as many worlds again are built from these label files of
            KITTI, whose ranges, headings and occlusions are those of real objects.
    """
    sensors = tuple(SENSORS)
    seeds = range(SEEDS_APART, SEEDS_APART + worlds)
    scans = simulated_scans(SCENES, seeds[: worlds // 2], TIMES_S, camera=False, sensors=sensors)
    if labels:
        scans = chain(scans, scans_from_labels(label_files(labels), seeds, sensors))
    _save_simulated(path, scans, {"synthetic": worlds, "placed": bool(labels), "seed": 1})


def simulated_crops(path: Path, kind: str, worlds: int, seed: int, sensors: Sequence[str] | None = None) -> None:
    """Write crops of simulated sweeps of worlds of a kind, a key of SIMULATED.

    Args:
        path: file to write (.npz).
        kind: kind of the worlds, named in the provenance.
        worlds: number of the worlds.
        seed: number that sets these worlds apart from others of the kind.
        sensors: sensors of the sweeps, in turn; by default those of the kind.
    """
    seeds = range(seed * SEEDS_APART, seed * SEEDS_APART + worlds)
    scans_of = SIMULATED[kind]
    _save_simulated(path, scans_of(seeds, sensors) if sensors else scans_of(seeds), {kind: worlds, "seed": seed})


def street_crops(path: Path, worlds: int, seed: int) -> None:
    """Write crops of a sweep each of so many simulated streets and crossings, as frequent as they are met."""
    writer = CropWriter()
    for scan in simulated_scans(
        SCENES, range(seed, seed + worlds // 2), TIMES_S[-1:], camera=False, sensors=tuple(SENSORS)
    ):
        writer.add(scan, SYNTHETIC, validation=True)
    print(writer.save(path, {"street": worlds, "seed": seed}), flush=True)


def _save_simulated(path: Path, scans: Iterable[Scan], provenance: dict[str, object]) -> None:
    writer = CropWriter()
    for scan, scale in zip(scans, cycle(SYNTHETIC_CELL_SCALES), strict=False):
        writer.add(scan, SYNTHETIC, scale, validation=True)
    print(writer.save(path, provenance), flush=True)
