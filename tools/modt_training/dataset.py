"""Data sets of crops, as tools.train.build_crops writes them."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from modt.classes import N_CLASSES, N_SHIPPED
from modt.classification.box_classifier import box_features
from modt.classification.crops import Crops
from modt.config import SensorConfig
from modt.geometry import upright_boxes
from modt.segmentation.groups import HEADINGS, Groups, best_headings
from modt.segmentation.tuning import HeadingTuning
from modt.types import NONE, Bool, Float64, Int

VARIANT_NAMES = ("shipped", "clustered", "pasted", "synthetic")
"""Names of the variants in the provenance of a file."""
REAL, CLUSTERED, PASTED, SYNTHETIC = range(4)
"""Variants of crops: real scans under the segmentation of their profile; real scans for training alone, most of them
under other cell sizes; real scans with pasted objects; simulated sweeps. The first of them that a data set has is
validated; the others are for training alone."""

FOLDS = 3
"""Folds of the cross-validation."""
SEED = 1
"""Seed of the first fold, and of the training on all crops."""
CLASS_SHARE = np.append([0.46, 0.24, 0.16, 0.14], np.full(N_CLASSES - N_SHIPPED, 0.16))
"""Share of each class in a batch; objects are rarer, background is more varied."""
VARIANT_SHARE = np.array(
    [[0.4, 0.35, 0.0, 0.25], [0.3, 0.25, 0.3, 0.15], [0.2, 0.15, 0.3, 0.35], [0.2, 0.15, 0.3, 0.35]]
)
"""Share of each variant in each class, where present; more generated crops
for the classes that are rare in real scans, which those of the user's own are too."""
TALL_SHARE = 0.3
"""Share of vans among the cars."""
BATCH_SIZE = 128
"""Number of labelled crops of a training step."""
Pools = list[tuple[Int, Float64 | None]]
"""Rows of each class, and the probability of each row, None where they are equal."""
CHUNK = 2000
"""Crops processed at a time."""
MAJORITY = "owner"
"""Column of a file that holds the majority: its name in files, so that the hashes on the model cards hold."""
NOT_CONCATENATED = ("offsets", "provenance", "truth_row")


@dataclass(frozen=True)
class Sensors:
    """Ground and resolution at each crop.

    Attributes:
        ground_z_m: (R,) height of the ground beneath, sensor frame.
        azimuth_deg, elevation_deg: (R,) between neighbouring returns of a beam, and between neighbouring beams there.
    """

    ground_z_m: Float64
    azimuth_deg: Float64
    elevation_deg: Float64

    @classmethod
    def of(cls, config: SensorConfig, box: Float64, ground_z_m: Float64) -> Sensors:
        """Columns of one sensor for crops in (R, 7) boxes on ground (R,), sensor frame."""
        tangent = box[:, 2] / np.maximum(np.hypot(box[:, 0], box[:, 1]), 1.0)
        columns = ground_z_m, config.azimuth_step_deg, np.rad2deg(config.beams.step_rad(tangent.astype(np.float32)))
        return cls(*(np.full(len(box), value, np.float64) for value in columns))

    @property
    def beam_sr(self) -> Float64:
        """(R,) solid angle of a point [sr]."""
        return np.deg2rad(self.azimuth_deg) * np.deg2rad(self.elevation_deg)

    def followed_by(self, other: Sensors) -> Sensors:
        """The sensors of these crops and of others after them."""
        return Sensors(
            *(np.concatenate(pair) for pair in zip(vars(self).values(), vars(other).values(), strict=True))
        )

    def take(self, rows: Int) -> Sensors:
        """The sensors of some rows."""
        return Sensors(self.ground_z_m[rows], self.azimuth_deg[rows], self.elevation_deg[rows])


@dataclass(frozen=True)
class LabelledObjects:
    """Labelled objects of the validation, those missed by the segmentation included.

    Attributes:
        label, points: (T,) class, and number of points in the annotated field of view.
        drive, sensor: (T,) as of the crops.
        row: (T,) the crop that is the whole object, NONE where it has none.
    """

    label: Int
    points: Int
    drive: Int
    sensor: Int
    row: Int

    def take(self, rows: Bool) -> LabelledObjects:
        """The objects of a mask (T,)."""
        return LabelledObjects(*(column[rows] for column in vars(self).values()))


@dataclass(frozen=True)
class Dataset:
    """Labelled crops in the sensor frame.

    Attributes:
        crops: R crops.
        sensors: sensors of the crops.
        label, majority, partial, unknown, tall: (R,) as in modt_training.crop_writer.Labels.
        variant, drive: (R,) variant and drive of each crop.
        sensor: (R,) index into `sensor_names`, for each crop.
        reflectance: (R, 5) statistics of the returns; NaN where unknown or measured by another sensor.
        truth: labelled objects of the validation.
        sensor_names: names of the sensors.
        provenance: options and counts of each file.
        sha256: SHA-256 of each file.
    """

    crops: Crops
    sensors: Sensors
    label: Int
    majority: Int
    partial: Bool
    unknown: Bool
    tall: Bool
    variant: Int
    drive: Int
    sensor: Int
    reflectance: Float64
    truth: LabelledObjects
    sensor_names: tuple[str, ...]
    provenance: list[dict[str, Any]]
    sha256: list[str]

    def __len__(self) -> int:
        return len(self.label)

    @property
    def trainable(self) -> Bool:
        """(R,) whole objects, and known background."""
        return is_trainable(self.partial, self.label, self.unknown)

    @property
    def validated(self) -> Bool:
        """(R,) crops of the variant that is validated: those of real scans, where the data set has any."""
        return np.asarray(self.variant == self.variant.min())

    def take(self, rows: Int) -> Crops:
        """Crops of rows (R,)."""
        count = self.crops.count[rows]
        offsets = np.append(0, np.cumsum(count))
        return Crops(
            self.crops.xyz[np.repeat(self.crops.offsets[rows] - offsets[:-1], count) + np.arange(offsets[-1])],
            offsets,
        )


def is_trainable(partial: Bool, label: Int, unknown: Bool) -> Bool:
    """(R,) whole objects, and known background."""
    return ~partial & ((label > 0) | ~unknown)


def load(*paths: Path) -> Dataset:
    """Read and concatenate data sets."""
    parts = []
    for path in paths:
        with np.load(path) as file:
            parts.append({key: file[key] for key in file.files})
    joined = {key: np.concatenate([part[key] for part in parts]) for key in parts[0] if key not in NOT_CONCATENATED}
    count = np.concatenate([np.diff(part["offsets"]) for part in parts])
    drive, drive_of_truth, _ = _numbers(joined["drive"], joined["truth_drive"])
    sensor, sensor_of_truth, names = _numbers(joined["sensor"], joined["truth_sensor"])
    first = np.cumsum([0, *(len(part["label"]) for part in parts)])
    row = [np.where(p["truth_row"] == NONE, NONE, p["truth_row"] + n) for p, n in zip(parts, first, strict=False)]
    return Dataset(
        crops=Crops(joined["xyz"], np.append(0, np.cumsum(count))),
        sensors=Sensors(joined["ground_z_m"], joined["azimuth_deg"], joined["elevation_deg"]),
        label=joined["label"].astype(np.int64),
        majority=joined[MAJORITY].astype(np.int64),
        partial=joined["partial"],
        unknown=joined["unknown"],
        tall=joined["tall"],
        variant=joined["variant"].astype(np.int64),
        reflectance=joined["reflectance"],
        drive=drive,
        sensor=sensor,
        truth=LabelledObjects(
            joined["truth_label"].astype(np.int64),
            joined["truth_points"],
            drive_of_truth,
            sensor_of_truth,
            np.concatenate(row).astype(np.int64),
        ),
        sensor_names=names,
        provenance=[json.loads(str(part["provenance"])) for part in parts],
        sha256=[hashlib.sha256(path.read_bytes()).hexdigest() for path in paths],
    )


def _numbers(of_crops: NDArray[np.str_], of_truth: NDArray[np.str_]) -> tuple[Int, Int, tuple[str, ...]]:
    """Places in the sorted names of crops and truth, and these names."""
    names, number = np.unique(np.concatenate([of_crops, of_truth]), return_inverse=True)
    return number[: len(of_crops)], number[len(of_crops) :], tuple(names.tolist())


def folds(data: Dataset, k: int) -> Int:
    """(D,) fold of each drive, rare classes balanced over folds; NONE for drives used in every training set."""
    has_truth = len(data.truth.drive) > 0
    drive, label = (data.truth.drive, data.truth.label) if has_truth else (data.drive, data.label)
    weight = np.zeros((int(max(data.drive.max(), drive.max())) + 1, N_CLASSES))
    np.add.at(weight, (drive, label), 1.0)
    weight /= weight.sum(axis=0).clip(1)
    load = np.zeros((k, N_CLASSES))
    fold = np.full(len(weight), NONE)
    validation = np.unique(data.drive[data.validated])
    for drive in validation[np.argsort(-weight[validation].max(axis=1), kind="stable")]:
        fold[drive] = np.argmin((load + weight[drive]).max(axis=1) + load.sum(axis=1) * 1e-3)
        load[fold[drive]] += weight[drive]
    return fold


def sampling_pools(data: Dataset, rows: Int, worth: Float64 | None = None) -> Pools:
    """Rows of each class and the probability of each row: equal within a class, variant and height.

    Args:
        data: all crops.
        rows: to draw from.
        worth: (len(data),) relative probability within these groups, equal by default.
    """
    worth = np.ones(len(data)) if worth is None else worth
    pools: Pools = []
    for c in range(N_CLASSES):
        of_class = rows[data.label[rows] == c]
        group = 2 * data.variant[of_class] + data.tall[of_class]
        share = np.outer(VARIANT_SHARE[min(c, len(VARIANT_SHARE) - 1)], [1 - TALL_SHARE, TALL_SHARE]).ravel()
        total = np.bincount(group, worth[of_class], minlength=len(share))
        weight = worth[of_class] * (share / np.where(total > 0, total, 1.0))[group]
        pools.append((of_class, weight / weight.sum()))
    return pools


def draw_batch(pools: Pools, rng: Generator, n: int = BATCH_SIZE, share: Float64 = CLASS_SHARE) -> Int:
    """At most n rows, classes by their shares; the share of a class without rows is lost."""
    number = rng.multinomial(n, share / share.sum())
    drawn = zip(pools, number, strict=True)
    return np.concatenate([rng.choice(rows, k, p=p) for (rows, p), k in drawn if len(rows)])


def crop_features(crops: Crops, sensors: Sensors) -> Float64:
    """(R, 7) features of the boxes fitted to crops."""
    x, y, z = crops.xyz.astype(np.float32).T
    groups = Groups(np.arange(len(x)), crops.offsets)
    heading = best_headings(x, y, groups, len(x), HeadingTuning().side_noise_m)
    box = upright_boxes(np.stack([x, y, z]), groups.offsets, HEADINGS[heading])
    return box_features(crops.count, box, sensors.ground_z_m, sensors.beam_sr)


def dataset_features(data: Dataset, rows: Int) -> Float64:
    """(R, 7) features of rows of a data set, without augmentation."""
    chunks = np.split(rows, np.arange(CHUNK, len(rows), CHUNK))
    return np.concatenate([crop_features(data.take(part), data.sensors.take(part)) for part in chunks])
