"""Copy-paste augmentation: labelled objects pasted into other real scans.

An object is rotated about the sensor, which preserves its aspect, and half of the objects are moved away along the
line of sight and thinned to the sensor's resolution. An object is set on the local ground; scene points behind it and
object points behind nearer scene points are removed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.random import Generator

from modt.classes import ObjectClass
from modt.config import SensorConfig
from modt.geometry import FieldOfView
from modt.types import Bool, Float32, Float64, Int
from modt_evaluation.overlap import PAD_M
from modt_training.scan import Scan

MIN_POINTS = 8
"""Least number of visible points of a pasted object."""
MIN_GROUND_POINTS = 5
"""Least number of scene points by which the ground of a place is known."""
CLEARANCE_M = 0.4
"""Points of the scene that are higher above the ground than this occupy a place."""
MAX_OCCUPIED_SHARE = 0.05
"""Greatest share of such points at a free place."""
OCCLUSION_MARGIN_M = 0.4
"""Points of the scene that are nearer than the object by this distance hide it."""
THINNED_FROM = 1.03
"""Factor on the range from which on an object is thinned to the resolution of the sensor."""
CLASS_SHARE = {ObjectClass.CAR: 0.36, ObjectClass.PEDESTRIAN: 0.36, ObjectClass.CYCLIST: 0.28}
SAME_RANGE_SHARE = 0.5
"""Share of objects that keep their range."""


@dataclass(frozen=True)
class ObjectCut:
    """The points of a labelled object.

    Attributes:
        points: (n, 4) sensor frame.
        box: (7,) as in Scan.
        kind: class.
        drive: its source.
    """

    points: Float32
    box: Float64
    kind: int
    drive: str


def cut_objects(scans: Iterable[Scan]) -> list[ObjectCut]:
    """Labelled objects with a box and at least 2 * MIN_POINTS points."""
    return [
        ObjectCut(scan.points[members], box, kind, scan.drive)
        for scan in scans
        for members, kind, box in zip(scan.objects, scan.kinds, scan.boxes, strict=True)
        if kind != ObjectClass.BACKGROUND and len(members) >= 2 * MIN_POINTS and np.isfinite(box).all()
    ]


def paste_objects(scan: Scan, cuts: list[ObjectCut], attempts: int, rng: Generator) -> Iterator[Scan]:
    """A scan with pasted objects for each of a few source drives, the other points unlabelled.

    Args:
        scan: to paste into.
        cuts: objects, of any drive.
        attempts: number of objects that are tried.
        rng: source of the choice of drives, objects and places.
    """
    by_class = {kind: [cut for cut in cuts if cut.kind == kind] for kind in CLASS_SHARE}
    sources = {rng.choice(sorted({cut.drive for cut in same})).item() for same in by_class.values() if same}
    by_drive: dict[str, list[ObjectCut]] = {}
    for kind in rng.choice(list(CLASS_SHARE), attempts, p=list(CLASS_SHARE.values())):
        candidates = [cut for cut in by_class[ObjectClass(kind)] if cut.drive in sources]
        if candidates:
            cut = candidates[rng.integers(len(candidates))]
            by_drive.setdefault(cut.drive, []).append(cut)
    for drive, chosen in by_drive.items():
        points = scan.points
        boxes = []
        kinds = []
        objects: list[Int] = []
        for cut in chosen:
            placed = _place(cut, points, scan.profile.sensor, rng)
            if placed is None:
                continue
            pasted, box, hidden = placed
            renumber = np.cumsum(~hidden) - 1
            objects = [renumber[o[~hidden[o]]] for o in objects]
            kept = points[~hidden]
            objects.append(np.arange(len(kept), len(kept) + len(pasted)))
            points = np.concatenate([kept, pasted])
            boxes.append(box)
            kinds.append(cut.kind)
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
            )


def _place(
    cut: ObjectCut, scene: Float32, sensor: SensorConfig, rng: Generator
) -> tuple[Float32, Float64, Bool] | None:
    """Points and box at a random free place, and a mask of the scene points occluded there; None if not possible."""
    angle = rng.uniform(-np.pi, np.pi)
    rho = float(np.hypot(*cut.box[:2]))
    factor = 1.0 if rng.random() < SAME_RANGE_SHARE else float(min(rng.uniform(1.0, 2.2), max(60.0 / rho, 1.0)))
    foot_x, foot_y = cut.box[:2] * factor
    target = np.array(_rotated(foot_x, foot_y, angle))
    ground = _free_ground(cut, scene, target, 0.3 + 0.02 * rho * factor)
    if ground is None:
        return None
    points = cut.points.copy()
    xy = cut.points[:, :2] + (factor - 1) * cut.box[:2]
    points[:, 0], points[:, 1] = _rotated(xy[:, 0], xy[:, 1], angle)
    points[:, 2] += ground - cut.box[2]
    if factor > THINNED_FROM:
        _, first = np.unique(_cells(points, sensor), return_index=True)
        points = points[first]
    visible, hidden = _occlusion(points, scene, sensor)
    if visible.sum() < max(MIN_POINTS, 0.2 * len(visible)):
        return None
    box = np.array([*target, ground, *cut.box[3:6], cut.box[6] + angle])
    return points[visible], box, hidden


def _rotated(x: Any, y: Any, angle: float) -> tuple[Any, Any]:
    """Coordinates rotated about the sensor."""
    c, s = np.cos(angle), np.sin(angle)
    return c * x - s * y, s * x + c * y


def _free_ground(cut: ObjectCut, scene: Float32, target: Float64, max_step_m: float) -> float | None:
    """Height of the ground at a place; None where it is unknown, higher or lower by a step, or occupied."""
    near = scene[np.hypot(scene[:, 0] - target[0], scene[:, 1] - target[1]) < max(cut.box[3] / 2 + PAD_M, 1.5)]
    if len(near) < MIN_GROUND_POINTS:
        return None
    ground = float(np.percentile(near[:, 2], 10))
    occupied = np.mean(near[:, 2] > ground + CLEARANCE_M) > MAX_OCCUPIED_SHARE
    return None if occupied or abs(ground - cut.box[2]) > max_step_m else ground


def _occlusion(points: Float32, scene: Float32, sensor: SensorConfig) -> tuple[Bool, Bool]:
    """(n,) points of an object that nothing of the scene stands before, and (N,) points of the scene behind them."""
    cells = _cells(points, sensor)
    sector = np.flatnonzero(_around(scene, points))
    beside = scene[sector]
    scene_cells = _cells(beside, sensor)
    distance = np.linalg.norm(points[:, :3], axis=1)
    scene_distance = np.linalg.norm(beside[:, :3], axis=1)
    in_front = (scene_distance < distance.min() - OCCLUSION_MARGIN_M) & (scene_distance > 2.0)
    visible = ~np.isin(cells, _dilate(scene_cells[in_front]))
    hidden = np.zeros(len(scene), np.bool_)
    hidden[sector] = np.isin(scene_cells, _dilate(cells[visible])) & (scene_distance > distance.mean())
    return visible, hidden


def _around(scene: Float32, points: Float32) -> Bool:
    """(N,) points of the scene in the directions of the points of an object, with a margin."""
    bearing = points[:, :2] / np.hypot(points[:, 0], points[:, 1])[:, None]
    middle = bearing.mean(axis=0) / np.linalg.norm(bearing.mean(axis=0))
    cos_half = np.cos(np.arccos(np.clip(bearing @ middle, -1.0, 1.0)).max() + np.deg2rad(1.0))
    within: Bool = scene[:, :2] @ middle > cos_half * np.hypot(scene[:, 0], scene[:, 1])
    return within


def _cells(points: Float32, sensor: SensorConfig) -> Int:
    azimuth = np.rad2deg(np.arctan2(points[:, 1], points[:, 0])) / sensor.azimuth_step_deg
    elevation = np.rad2deg(np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1]))) / sensor.elevation_step_deg
    return (np.floor(azimuth).astype(np.int64) << 16) + np.floor(elevation).astype(np.int64) + 8192


def _dilate(cells: Int) -> Int:
    """Cells with their neighbours in azimuth."""
    return np.unique(np.concatenate([cells - (1 << 16), cells, cells + (1 << 16)]))
