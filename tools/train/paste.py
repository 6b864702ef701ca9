"""Real objects pasted into real scans: new surroundings, ranges and occlusions for the few that are labelled.

An object is turned about the sensor, which keeps the view of it true, or moved away along its line of sight and
thinned to the sensor's resolution. It stands on the ground that it finds, casts its shadow on what lies behind it,
and loses what something nearer hides. The segmentation then decides what becomes of it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator

from modt.classes import ObjectClass
from modt.evaluation.overlap import PAD_M
from modt.geometry import FieldOfView
from modt.types import Float32, Float64, Int
from tools.train.augment import Beams
from tools.train.labelled_scans import Scan

FEWEST, CLEARANCE_M, HIDDEN_M = 8, 0.4, 0.4
SHARE = {ObjectClass.CAR: 0.36, ObjectClass.PEDESTRIAN: 0.36, ObjectClass.CYCLIST: 0.28}
BACK = 0.5
"""Share of objects that keep their range."""


@dataclass(frozen=True)
class Item:
    """An object cut from its scan.

    Attributes:
        points: (n, 4) sensor frame.
        box: (7,) as in a scan.
        kind, drive: what it is and where from.
    """

    points: Float32
    box: Float64
    kind: ObjectClass
    drive: str


def library(scans: Iterable[Scan]) -> list[Item]:
    """Every labelled object that shows enough points."""
    return [
        Item(scan.points[own], box, kind, scan.drive)
        for scan in scans
        for own, kind, box in zip(scan.objects, scan.kinds, scan.boxes, strict=True)
        if kind != ObjectClass.BACKGROUND and len(own) >= 2 * FEWEST and np.isfinite(box).all()
    ]


def pasted(scan: Scan, items: list[Item], tries: int, rng: Generator) -> Iterator[Scan]:
    """The scan with objects of one drive at a time, all else unlabelled; tries objects in all."""
    by_kind = {kind: [item for item in items if item.kind == kind] for kind in SHARE}
    by_drive: dict[str, list[Item]] = {}
    for kind in rng.choice(list(SHARE), tries, p=list(SHARE.values())):
        item = by_kind[ObjectClass(kind)][rng.integers(len(by_kind[ObjectClass(kind)]))]
        by_drive.setdefault(item.drive, []).append(item)
    beams = Beams()
    for drive, chosen in by_drive.items():
        points, objects, boxes, kinds = scan.points, [], [], []
        for item in chosen:
            placed = _place(item, points, beams, rng)
            if placed is None:
                continue
            own, box, hidden = placed
            renumber = np.cumsum(~hidden) - 1
            objects = [renumber[o[~hidden[o]]] for o in objects]
            kept = points[~hidden]
            objects.append(np.arange(len(kept), len(kept) + len(own)))
            points = np.concatenate([kept, own])
            boxes.append(box)
            kinds.append(item.kind)
        if objects:
            unknown = np.ones(len(points), np.bool_)
            unknown[np.concatenate(objects)] = False
            yield replace(
                scan,
                drive=drive,
                points=points,
                objects=tuple(objects),
                kinds=tuple(kinds),
                boxes=np.array(boxes),
                fov=FieldOfView(),
                unlabelled=unknown,
                numbers=(),
            )


def _place(item: Item, scene: Float32, beams: Beams, rng: Generator) -> tuple[Float32, Float64, np.ndarray] | None:
    """The object's points and box somewhere else, and which of the scene's points it hides; None if it cannot be."""
    angle = rng.uniform(-np.pi, np.pi)
    rho = float(np.hypot(*item.box[:2]))
    factor = 1.0 if rng.random() < BACK else float(min(rng.uniform(1.0, 2.2), max(60.0 / rho, 1.0)))
    c, s = np.cos(angle), np.sin(angle)
    xy = item.points[:, :2] + (factor - 1) * item.box[:2]
    foot = item.box[:2] * factor
    target = np.array([c * foot[0] - s * foot[1], s * foot[0] + c * foot[1]])
    near = scene[np.hypot(scene[:, 0] - target[0], scene[:, 1] - target[1]) < max(item.box[3] / 2 + PAD_M, 1.5)]
    if len(near) < 5:
        return None
    ground = float(np.percentile(near[:, 2], 10))
    if abs(ground - item.box[2]) > 0.3 + 0.02 * rho * factor or np.mean(near[:, 2] > ground + CLEARANCE_M) > 0.05:
        return None
    points = item.points.copy()
    points[:, 0], points[:, 1] = c * xy[:, 0] - s * xy[:, 1], s * xy[:, 0] + c * xy[:, 1]
    points[:, 2] += ground - item.box[2]
    cells = _cells(points, beams)
    if factor > 1.03:
        _, first = np.unique(cells, return_index=True)
        points, cells = points[first], cells[first]
    scene_cells = _cells(scene, beams)
    distance, scene_distance = np.linalg.norm(points[:, :3], axis=1), np.linalg.norm(scene[:, :3], axis=1)
    front = np.flatnonzero((scene_distance < distance.min() - HIDDEN_M) & (scene_distance > 2.0))
    seen = ~np.isin(cells, _spread(scene_cells[front]))
    points, cells = points[seen], cells[seen]
    if seen.sum() < max(FEWEST, 0.2 * len(seen)):
        return None
    hidden = np.isin(scene_cells, _spread(cells)) & (scene_distance > distance.mean())
    box = np.array([*target, ground, *item.box[3:6], item.box[6] + angle])
    return points, box, hidden


def _cells(points: Float32, beams: Beams) -> Int:
    azimuth = np.rad2deg(np.arctan2(points[:, 1], points[:, 0])) / beams.azimuth_deg
    elevation = np.rad2deg(np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1]))) / beams.elevation_deg
    return (np.floor(azimuth).astype(np.int64) << 16) + np.floor(elevation).astype(np.int64) + 8192


def _spread(cells: Int) -> Int:
    """These cells and their neighbours to either side."""
    return np.unique(np.concatenate([cells - (1 << 16), cells, cells + (1 << 16)]))
