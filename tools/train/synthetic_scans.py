"""Simulated sweeps as labelled scans."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import cycle
from pathlib import Path

import numpy as np

from modt import profile
from modt.geometry import FieldOfView
from modt.types import Frame
from modt_desk.simulation.simulator import Truth
from modt_desk.simulation.synthetic_stream import CAMERA, SyntheticStream
from tools.train.label_scenes import label_scene
from tools.train.labelled_scans import TEST_DRIVE, Scan

PEOPLE = ("Pedestrian", "Cyclist", "Person_sitting")
SECONDS = 4.0


def labelled_scan(
    frame: Frame, truth: Truth, name: str, world: str, *, camera: bool, sensor: str = profile.DEFAULT
) -> Scan:
    """A simulated sweep as a labelled scan, in the camera's view or over the full circle."""
    order = np.argsort(truth.instance, kind="stable")
    ends = np.searchsorted(truth.instance[order], truth.bodies, side="right")
    objects = [order[end - n : end] for end, n in zip(ends, truth.points, strict=True)]
    return Scan(
        name,
        world,
        frame.points,
        tuple(objects),
        tuple(kind.object_class for kind in truth.kinds),
        truth.boxes - np.outer(truth.boxes[:, 5] / 2, np.eye(7)[2]),
        FieldOfView.of_camera(CAMERA) if camera else FieldOfView(),
        np.zeros(len(frame.points), np.bool_),
        sensor,
        profile.load(sensor),
    )


def simulated_scans(
    scenes: Sequence[str],
    seeds: Sequence[int],
    times_s: Sequence[float],
    *,
    camera: bool,
    sensors: Sequence[str] = (profile.DEFAULT,),
) -> Iterator[Scan]:
    """Sweeps at the given times of a short drive through each scene, for each seed, by one sensor after another."""
    in_turn = cycle(sensors)
    for seed in seeds:
        for scene in scenes:
            simulator = SyntheticStream(scene, sensor := next(in_turn), SECONDS, seed).simulator
            for time_s in times_s:
                frame, truth = simulator.sweep(round(time_s / simulator.sensor.period_s))
                name = f"{scene}-{seed}"
                yield labelled_scan(frame, truth, f"{name}/{frame.index}", name, camera=camera, sensor=sensor)


def scans_from_labels(files: Sequence[Path], seeds: Sequence[int], sensors: Sequence[str]) -> Iterator[Scan]:
    """A sweep of a world built from a random label file, for each seed, by one sensor after another."""
    for seed, sensor in zip(seeds, cycle(sensors), strict=False):
        path = files[int(np.random.default_rng(seed).integers(len(files)))]
        frame, truth = label_scene(path, seed, sensor).sweep(0)
        yield labelled_scan(frame, truth, f"{path.stem}-{seed}", f"placed-{seed}", camera=True, sensor=sensor)


def label_files(folder: Path) -> list[Path]:
    """Label files under training_all_labels except those of the test drive; files with people listed four times."""
    rows = (line.split("\t") for line in (folder / "frame_to_raw.tsv").read_text(encoding="utf-8").splitlines())
    drive = {row[0]: row[2] for row in rows}
    files = [p for p in sorted((folder / "label_2").glob("*.txt")) if drive.get(p.stem, TEST_DRIVE) != TEST_DRIVE]
    rich = [p for p in files if any(line.startswith(PEOPLE) for line in p.read_text(encoding="utf-8").splitlines())]
    return files + 3 * rich
