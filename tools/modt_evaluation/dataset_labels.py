"""Labels of nuScenes and of Argoverse 2."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

import numpy as np

from modt.errors import MisuseError
from modt.sources import argoverse, nuscenes
from modt.types import Float64
from modt_evaluation.kitti_labels import Label
from modt_evaluation.label_names import WITHOUT_RIDER

ANNOTATIONS = "annotations.feather"
Objects = dict[int, list[Label]]
"""Labels by frame. Boxes lie in the frame of the poses (nuScenes), or in that of the vehicle (Argoverse)."""


def nuscenes_labels(scene: nuscenes.Scene) -> Objects:
    """Labels of the key frames of a scene; each has a list.

    Raises:
        MisuseError: a table is missing or broken.
    """
    tables = scene.tables
    frame_of = {sample: frame for frame, sample in scene.sample_of_frame().items()}
    columns = ("sample_token", "instance_token", "translation", "size", "rotation", "attribute_tokens")
    rows = [r for r in nuscenes.read_table(tables, "sample_annotation", *columns) if r["sample_token"] in frame_of]
    categories = {row["token"]: row["name"] for row in nuscenes.read_table(tables, "category", "token", "name")}
    instances = nuscenes.read_table(tables, "instance", "token", "category_token")
    kind_of = {row["token"]: row["category_token"] for row in instances}
    attributes = {row["token"]: row["name"] for row in nuscenes.read_table(tables, "attribute", "token", "name")}
    ids: dict[str, int] = {}
    labels: Objects = {frame: [] for frame in frame_of.values()}
    for row in rows:
        frame = frame_of[row["sample_token"]]
        try:
            T = nuscenes.placement(row)
            width, length, height = map(float, row["size"])
            name = categories[kind_of[row["instance_token"]]]
            ridden = [attributes[token] for token in row["attribute_tokens"]]
        except (KeyError, TypeError, ValueError) as error:
            raise MisuseError(tables / "sample_annotation.json", f"no box ({error})", nuscenes.REMEDY) from None
        if "cycle.without_rider" in ridden:
            name += WITHOUT_RIDER
        box = np.array([*T[:3, 3], length, width, height, _yaw(T[:3, :3])])
        labels[frame].append(Label(frame, ids.setdefault(row["instance_token"], len(ids)), name, box))
    return labels


def argoverse_labels(log: Path, frame_of: dict[int, int]) -> Objects:
    """Labels of the sweeps of a log by the time of each [ns]; each labelled sweep has a list.

    Raises:
        MisuseError: the annotations are missing or broken.
    """
    sizes = ("length_m", "width_m", "height_m")
    path = log / ANNOTATIONS
    table = argoverse.read_columns(path, ("timestamp_ns", "track_uuid", "category", *sizes, *argoverse.PLACEMENT))
    ids: dict[str, int] = {}
    labels: Objects = defaultdict(list)
    placed = argoverse.placements(path, table)
    size_m = np.column_stack([table[name] for name in sizes]).astype(np.float64)
    if not np.isfinite(size_m).all():
        raise MisuseError(path, "holds a box that is none", "restore the file")
    for k, time_ns in enumerate(table["timestamp_ns"].tolist()):
        frame = frame_of.get(time_ns)
        if frame is not None:
            box = np.array([*placed[k][:3, 3], *size_m[k], _yaw(placed[k][:3, :3])])
            id_ = ids.setdefault(table["track_uuid"][k], len(ids))
            labels[frame].append(Label(frame, id_, str(table["category"][k]), box))
    return dict(labels)


def _yaw(rotation: Float64) -> float:
    return float(np.arctan2(rotation[1, 0], rotation[0, 0]))
