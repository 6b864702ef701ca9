"""Synthetic scans with the labels of real ones, for training and for comparison."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from labelled import Scan
from modt.geometry import FieldOfView
from modt.sources.synthetic.simulator import Simulator, Truth
from modt.sources.synthetic.stream import nominal_camera
from modt.types import Frame


def scan_of(frame: Frame, truth: Truth, name: str, world: str, *, camera: bool = True) -> Scan:
    """One sweep as a labelled scan; with the camera's view or all around."""
    boxes = truth.boxes - np.array([0, 0, 0.5, 0, 0, 0, 0]) * truth.boxes[:, 5:6]
    return Scan(
        name,
        world,
        frame.points,
        boxes,
        tuple(kind.name for kind in truth.kinds),
        FieldOfView.of_camera(nominal_camera()) if camera else FieldOfView(),
        np.zeros(len(frame.points), np.bool_),
    )


def synthetic_scans(
    worlds: Iterable[tuple[str, Simulator]], indices: Iterable[int], *, camera: bool = True
) -> Iterator[Scan]:
    """The frames given of every world."""
    for name, simulator in worlds:
        for i in indices:
            frame, truth = simulator.sweep(i)
            yield scan_of(frame, truth, f"{name}/{i:06d}", name, camera=camera)
