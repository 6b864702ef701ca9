"""A run as nuScenes' results of detection and tracking, and their score by the definitions of its benchmark."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from modt.classes import ObjectClass
from modt.errors import MisuseError
from modt.geometry import inverse, transform_boxes
from modt.placement import Mount
from modt.sources import nuscenes
from modt.types import NONE, Float64, Frame, FrameResult, Int, MotionState, Tracks
from modt_evaluation.recorded_result import NO_POINTS

NAMES = {ObjectClass.CAR: "car", ObjectClass.PEDESTRIAN: "pedestrian", ObjectClass.CYCLIST: "bicycle"}
"""nuScenes' name of each class; riders of motorcycles are cyclists too."""
ATTRIBUTES = {
    "car": ("vehicle.parked", "vehicle.moving"),
    "pedestrian": ("pedestrian.standing", "pedestrian.moving"),
    "bicycle": ("cycle.with_rider", "cycle.with_rider"),
}
"""Attribute of what rests and of what moves."""
CATEGORIES = {
    "vehicle.car": "car",
    "vehicle.bicycle": "bicycle",
    **{
        f"human.pedestrian.{kind}": "pedestrian"
        for kind in ("adult", "child", "construction_worker", "police_officer")
    },
}
"""Name of each category that is scored."""
RACK = "static_object.bicycle_rack"
RANGE_M = {"car": 50.0, "pedestrian": 40.0, "bicycle": 40.0}
"""Distance from the vehicle up to which a class is scored."""
MOST_BOXES = 500
"""Greatest number of boxes of a sample."""
DISTANCES_M = (0.5, 1.0, 2.0, 4.0)
"""Distances of the centres within which a box is right, over which average precision is averaged."""
ERROR_M = 2.0
"""Distance within which errors are measured."""
RECALLS = np.linspace(0, 1, 101)
"""Recalls over which precision and errors are averaged."""
LEAST_RECALL = 0.1
LEAST_PRECISION = 0.1
"""Recall and precision below which nothing counts."""
LONGEST_GAP_S = 1.5
"""Longest time between two samples over which a velocity is measured."""
META = {"use_camera": False, "use_lidar": True, "use_radar": False, "use_map": False, "use_external": False}
DIGITS = 6
Row = dict[str, Any]
Results = dict[str, list[Row]]
"""Boxes by the token of the sample."""


def scene_of(path: Path | None) -> nuscenes.Scene:
    """The scene that a run has read.

    Raises:
        MisuseError: it has read something else.
    """
    tables = None if path is None else nuscenes.tables_of(path)
    if tables is None:
        raise MisuseError(path or "the run", "was not made of a scene of nuScenes", "replay DATA/SCENE")
    return nuscenes.read_scene(*tables)


def results_of(scene: nuscenes.Scene, mount: Mount, run: Iterator[FrameResult]) -> Results:
    """Reported objects of each key frame of a scene, in its world; the most probable ones of too many."""
    tokens = scene.sample_of_frame()
    boxes: Results = {token: [] for token in tokens.values()}
    for result in run:
        frame = result.frame.index
        if frame in tokens:
            pose = mount.level(Frame(frame, 0.0, NO_POINTS, scene.poses[frame])).T_world_sensor
            moved = np.eye(4) if pose is None else pose @ inverse(result.T_world_sensor)
            rows = list(_rows(tokens[frame], result.tracks, moved))
            boxes[tokens[frame]] = sorted(rows, key=lambda row: -float(row["detection_score"]))[:MOST_BOXES]
    return boxes


def _rows(token: str, tracks: Tracks, T_scene_world: Float64) -> Iterator[Row]:
    """Boxes of the tracks that are seen and have a class; of detection and of tracking together."""
    seen = np.flatnonzero((tracks.proposal != NONE) & (tracks.object_class != ObjectClass.BACKGROUND))
    boxes = transform_boxes(T_scene_world, tracks.whole_box[seen])
    velocities = tracks.velocity[seen] @ T_scene_world[:2, :2].T
    for track, box, velocity in zip(seen.tolist(), boxes.round(DIGITS), velocities.round(DIGITS), strict=True):
        name = NAMES[ObjectClass(tracks.object_class[track])]
        x, y, z, length, width, height, yaw = box.tolist()
        score = round(float(tracks.posterior[track, tracks.object_class[track]]), DIGITS)
        yield {
            "sample_token": token,
            "translation": [x, y, z],
            "size": [width, length, height],
            "rotation": [float(np.cos(yaw / 2)), 0.0, 0.0, float(np.sin(yaw / 2))],
            "velocity": velocity.tolist(),
            "detection_name": name,
            "detection_score": score,
            "attribute_name": ATTRIBUTES[name][int(tracks.motion[track] == MotionState.MOVING)],
            "tracking_id": str(int(tracks.id[track])),
            "tracking_name": name,
            "tracking_score": score,
        }


def submission(results: Results, task: str) -> dict[str, Any]:
    """The file of a task, `detection` or `tracking`."""
    other = {"detection": ("tracking_",), "tracking": ("detection_", "attribute_")}[task]
    rows = {
        token: [{key: value for key, value in row.items() if not key.startswith(other)} for row in boxes]
        for token, boxes in results.items()
    }
    return {"meta": META, "results": rows}


@dataclass(frozen=True)
class NuscenesScore:
    """Score of a class as nuScenes' detection benchmark has it; errors are 1 below the least recall."""

    objects: int  # labelled
    ap: float  # average precision, mean over DISTANCES_M
    translation_m: float  # ATE
    scale: float  # ASE
    orientation_rad: float  # AOE
    velocity_mps: float  # AVE


ERRORS = ("translation_m", "scale", "orientation_rad", "velocity_mps")


@dataclass(frozen=True)
class Boxes:
    """Boxes of one class: sample, centre, size, yaw, velocity and score of each."""

    sample: tuple[str, ...]
    centre: Float64  # (n, 2) [m]
    size: Float64  # (n, 3) [m]
    yaw: Float64  # (n,) [rad]
    velocity: Float64  # (n, 2) [m/s], NaN where it is not known
    score: Float64  # (n,)

    @classmethod
    def of(cls, rows: Sequence[Row]) -> Boxes:
        """Boxes of rows as in a file of results."""
        turn = np.array([row["rotation"] for row in rows]).reshape(-1, 4)
        w, x, y, z = (turn / np.linalg.norm(turn, axis=1, keepdims=True)).T
        return cls(
            tuple(row["sample_token"] for row in rows),
            np.array([row["translation"][:2] for row in rows]).reshape(-1, 2),
            np.array([row["size"] for row in rows]).reshape(-1, 3),
            np.arctan2(2 * (x * y + w * z), 1 - 2 * (y * y + z * z)),
            np.array([row["velocity"] for row in rows], np.float64).reshape(-1, 2),
            np.array([row.get("detection_score", -1.0) for row in rows]),
        )


def scores(runs: Sequence[tuple[nuscenes.Scene, Results]]) -> dict[str, NuscenesScore]:
    """Score of each class over the results of some scenes."""
    found = {}
    racks = {scene.name: _racks(scene) for scene, _ in runs}
    for name in RANGE_M:
        true = [r for scene, _ in runs for r in _scored(scene, racks[scene.name], name, _labels(scene, name))]
        given = [
            row
            for scene, results in runs
            for row in _scored(scene, racks[scene.name], name, (r for rows in results.values() for r in rows))
            if row["detection_name"] == name
        ]
        found[name] = _score(Boxes.of(true), Boxes.of(given))
    return found


def _annotations(scene: nuscenes.Scene) -> Iterator[Row]:
    """Annotations of the key frames with the name of their category."""
    columns = ("token", "sample_token", "instance_token", "translation", "size", "rotation", "prev", "next")
    rows = nuscenes.read_table(scene.tables, "sample_annotation", *columns, "num_lidar_pts", "num_radar_pts")
    names = {row["token"]: row["name"] for row in nuscenes.read_table(scene.tables, "category", "token", "name")}
    instances = nuscenes.read_table(scene.tables, "instance", "token", "category_token")
    name_of = {row["token"]: names[row["category_token"]] for row in instances}
    wanted = set(scene.sample_of_frame().values())
    return ({**row, "name": name_of[row["instance_token"]]} for row in rows if row["sample_token"] in wanted)


def _labels(scene: nuscenes.Scene, name: str) -> Iterator[Row]:
    """Labels of a class that hold a point, with their velocities."""
    rows = list(_annotations(scene))
    by_token = {row["token"]: row for row in rows}
    samples = nuscenes.read_table(scene.tables, "sample", "token", "timestamp")
    time_s = {row["token"]: 1e-6 * row["timestamp"] for row in samples}
    for row in rows:
        if CATEGORIES.get(row["name"]) == name and row["num_lidar_pts"] + row["num_radar_pts"]:
            first = by_token.get(row["prev"], row)
            last = by_token.get(row["next"], row)
            gap_s = time_s[last["sample_token"]] - time_s[first["sample_token"]]
            longest_s = LONGEST_GAP_S * (2 if row["prev"] and row["next"] else 1)
            way = np.subtract(last["translation"], first["translation"])[:2]
            velocity = way / gap_s if 0 < gap_s <= longest_s else np.full(2, np.nan)
            yield {**row, "velocity": velocity}


def _racks(scene: nuscenes.Scene) -> dict[str, list[tuple[Float64, Float64]]]:
    """Transform into each bicycle rack, and half its length, width and height [m], by sample."""
    racks: dict[str, list[tuple[Float64, Float64]]] = {}
    for row in _annotations(scene):
        if row["name"] == RACK:
            half = np.array(row["size"])[[1, 0, 2]] / 2
            racks.setdefault(row["sample_token"], []).append((inverse(nuscenes.placement(row)), half))
    return racks


def _scored(
    scene: nuscenes.Scene, racks: Mapping[str, list[tuple[Float64, Float64]]], name: str, rows: Iterator[Row]
) -> Iterator[Row]:
    """Rows within the range of a class; bicycles in a rack are left out."""
    place = {token: scene.vehicles[frame][:2, 3] for frame, token in scene.sample_of_frame().items()}
    for row in rows:
        centre = np.array([*row["translation"], 1.0])
        if np.hypot(*(centre[:2] - place[row["sample_token"]])) >= RANGE_M[name]:
            continue
        around = racks.get(row["sample_token"], []) if name == "bicycle" else []
        if not any((np.abs((T @ centre)[:3]) <= half).all() for T, half in around):
            yield row


def _score(true: Boxes, given: Boxes) -> NuscenesScore:
    """Score of the boxes of one class."""
    n = len(true.sample)
    precisions = []
    errors = [1.0] * len(ERRORS)
    first = round(100 * LEAST_RECALL) + 1  # the first recall that counts
    for distance_m in DISTANCES_M:
        order, match = _matched(true, given, distance_m)
        hit = match != NONE
        if not hit.any():
            precisions.append(0.0)
            continue
        hits = np.cumsum(hit)
        recall = hits / n
        precision = np.interp(RECALLS, recall, hits / np.arange(1, len(hit) + 1), right=0)
        above = np.maximum(precision[first:] - LEAST_PRECISION, 0.0)
        precisions.append(float(above.mean()) / (1.0 - LEAST_PRECISION))
        confidence = np.interp(RECALLS, recall, given.score[order], right=0)
        last = int(np.flatnonzero(confidence)[-1]) if confidence.any() else 0  # the last recall that is reached
        if distance_m == ERROR_M and last >= first:
            means = _mean_errors(true, given, order[hit], match[hit], confidence)
            errors = [float(mean[first : last + 1].mean()) for mean in means]
    return NuscenesScore(n, float(np.mean(precisions)), *errors)


def _matched(true: Boxes, given: Boxes, distance_m: float) -> tuple[Int, Int]:
    """Order of the boxes by falling score, and the label that each takes in this order, NONE without one."""
    order = np.lexsort((np.arange(len(given.score)), given.score))[::-1]
    of_sample: dict[str, list[int]] = {}
    for k, sample in enumerate(true.sample):
        of_sample.setdefault(sample, []).append(k)
    match = np.full(len(order), NONE)
    for place, k in enumerate(order.tolist()):
        free = of_sample.get(given.sample[k], [])
        apart_m = np.linalg.norm(true.centre[free] - given.centre[k], axis=1)
        if len(free) and apart_m.min() < distance_m:
            match[place] = free.pop(int(apart_m.argmin()))
    return order, match


def _mean_errors(
    true: Boxes, given: Boxes, given_rows: Int, true_rows: Int, confidence: Float64
) -> Iterator[Float64]:
    """(101,) means of each error over the matches (m,) whose confidence is at least that at each of RECALLS."""
    true_size = true.size[true_rows]
    size = given.size[given_rows]
    shared = np.minimum(true_size, size).prod(axis=1)
    union = true_size.prod(axis=1) + size.prod(axis=1) - shared
    turned = true.yaw[true_rows] - given.yaw[given_rows]
    errors = (
        np.linalg.norm(true.centre[true_rows] - given.centre[given_rows], axis=1),
        1 - shared / union,
        np.abs((turned + np.pi) % (2 * np.pi) - np.pi),
        np.linalg.norm(true.velocity[true_rows] - given.velocity[given_rows], axis=1),
    )
    score = given.score[given_rows]
    for error in errors:
        known = np.cumsum(~np.isnan(error))
        mean = np.nancumsum(error) / np.maximum(known, 1) if known[-1] else np.ones(len(error))
        # Scores fall, and np.interp wants them to rise.
        yield np.interp(confidence[::-1], score[::-1], mean[::-1])[::-1]
