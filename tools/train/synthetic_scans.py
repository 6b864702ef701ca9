"""Simulated sweeps as labelled scans, and worlds built from KITTI's label files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import cycle
from pathlib import Path

import numpy as np

from modt import profile
from modt_evaluation.kitti_labels import read_labels
from modt_simulation import kinds, road, roadside
from modt_simulation.builder import SceneBuilder
from modt_simulation.motion import Path as Trajectory
from modt_simulation.sensors import sensor as model_of
from modt_simulation.simulator import Simulator
from modt_simulation.street import furnish, residential
from modt_training.scan import Scan
from modt_training.simulated import labelled_scan
from tools.train.labelled_scans import AT_SENSOR, TEST_DRIVE, drives_of_frames

PEOPLE = ("Pedestrian", "Cyclist", "Person_sitting")
CAMERA_AHEAD_M = 0.27
"""Place of the camera of the label files, ahead of the sensor."""
KINDS = {
    kind.name: kind for kind in (kinds.CAR, kinds.VAN, kinds.TRUCK, kinds.PEDESTRIAN, kinds.SITTER, kinds.CYCLIST)
} | {"Tram": kinds.TRUCK}
"""Simulated kind of each KITTI object type."""


def scans_from_labels(files: Sequence[Path], seeds: Sequence[int], sensors: Sequence[str]) -> Iterator[Scan]:
    """A sweep of a world built from a random label file, for each seed, by one sensor after another."""
    for seed, sensor in zip(seeds, cycle(sensors), strict=False):
        path = files[int(np.random.default_rng(seed).integers(len(files)))]
        frame, truth = label_scene(path, seed, sensor).sweep(0)
        yield labelled_scan(frame, truth, f"{path.stem}-{seed}", f"placed-{seed}", camera=True, sensor=sensor)


def label_scene(path: Path, seed: int, sensor: str = profile.DEFAULT) -> Simulator:
    """Simulator of a residential street with the objects of a label file alone, all at rest, as is the sensor.

    Raises:
        MisuseError: the file is unreadable or no label file.
    """
    labels = read_labels(path, AT_SENSOR, tracking=False)
    model = model_of(sensor)
    rng = np.random.default_rng([seed, 0])
    street = residential(rng, 60.0)
    builder = SceneBuilder(rng, model.period_s)
    x0, y0, yaw0 = street.place(0.0, -street.half_m * roadside.LANE)
    c, s = np.cos(yaw0), np.sin(yaw0)
    for label in labels:
        kind = KINDS.get(label.type_)
        if kind is None:
            continue
        x, y, _, length, width, height, yaw = label.box.tolist()
        x += CAMERA_AHEAD_M
        spot = Trajectory.standing(x0 + c * x - s * y, y0 + s * x + c * y, yaw0 + yaw)
        if kind in (kinds.CAR, kinds.VAN, kinds.TRUCK):
            builder.vehicle(kind, spot, (length, width, height))
        elif kind is kinds.CYCLIST:
            builder.cyclist(spot, 0.0, height=height * 0.97)
        elif kind is kinds.SITTER:
            builder.sitter(spot)
        else:
            walking = rng.random() < 0.7
            builder.pedestrian(spot, float(rng.uniform(0.8, 1.8)) if walking else 0.0, height=height)
    furnish(builder, street)
    world = builder.world(road.terrain_along(rng, street), Trajectory.standing(x0, y0, yaw0), model.height_m)
    return Simulator(world, model, seed)


def label_files(folder: Path) -> list[Path]:
    """Label files under training_all_labels except those of the test drive; files with people listed four times."""
    drive = drives_of_frames(folder)
    files = [p for p in sorted((folder / "label_2").glob("*.txt")) if drive.get(p.stem, TEST_DRIVE) != TEST_DRIVE]
    rich = [p for p in files if any(line.startswith(PEOPLE) for line in p.read_text(encoding="utf-8").splitlines())]
    return files + 3 * rich
