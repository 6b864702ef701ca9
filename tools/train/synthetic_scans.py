"""Synthetic sweeps with the labels of real scans, for comparison and for training."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from modt.geometry import FieldOfView
from modt.simulation.simulator import Truth
from modt.sources.synthetic_stream import SyntheticStream, nominal_camera
from modt.types import Frame
from tools.train.labelled_scans import TEST_DRIVE, Scan

RICH = ("Pedestrian", "Cyclist", "Person_sitting")
SECONDS = 4.0


def scan_of(frame: Frame, truth: Truth, name: str, world: str, *, camera: bool) -> Scan:
    """One sweep as a labelled scan, in the camera's view or all around."""
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
        FieldOfView.of_camera(nominal_camera()) if camera else FieldOfView(),
        np.zeros(len(frame.points), np.bool_),
        tuple(truth.bodies.tolist()),
    )


def driven(scenes: Sequence[str], seeds: Sequence[int], times_s: Sequence[float], *, camera: bool) -> Iterator[Scan]:
    """Sweeps at these times of a short drive through each scene, for each seed."""
    for seed in seeds:
        for scene in scenes:
            simulator = SyntheticStream(scene, "hdl-64e", SECONDS, seed).simulator
            for time_s in times_s:
                frame, truth = simulator.sweep(round(time_s / simulator.sensor.period_s))
                name = f"{scene}-{seed}"
                yield scan_of(frame, truth, f"{name}/{frame.index}", name, camera=camera)


def placed(files: Sequence[Path], seeds: Sequence[int]) -> Iterator[Scan]:
    """A sweep for each seed of a world built from a label file drawn by it."""
    for seed in seeds:
        path = files[int(np.random.default_rng(seed).integers(len(files)))]
        frame, truth = SyntheticStream(str(path), "hdl-64e", 0.1, seed).simulator.sweep(0)
        yield scan_of(frame, truth, f"{path.stem}-{seed}", f"placed-{seed}", camera=True)


def label_files(folder: Path) -> list[Path]:
    """Label files under training_all_labels that may be learnt from; those with people stand for four.

    Those of the test drive are left out, by the table of drives beside them.
    """
    rows = (line.split("\t") for line in (folder / "frame_to_raw.tsv").read_text(encoding="utf-8").splitlines())
    drive = {row[0]: row[2] for row in rows}
    files = [p for p in sorted((folder / "label_2").glob("*.txt")) if drive.get(p.stem, TEST_DRIVE) != TEST_DRIVE]
    rich = [p for p in files if any(line.startswith(RICH) for line in p.read_text(encoding="utf-8").splitlines())]
    return files + 3 * rich
