"""Poses in the headers of PCD files, and the frame in which their points are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from modt.geometry import inverse, se3
from modt.sources.point_cloud_file import MAX_HEADER_BYTES, CloudError, read_pcd, viewpoint_of
from modt.types import Float64

JUDGED = 3
"""Number of files, those farthest from the origin, by which it is judged in which frame the points are."""
FAR_M = 2.0
"""Distance from the origin beyond which points around the sensor and around the origin can be told apart [m]."""
SAME_M = 1e-3
"""Poses that differ by less are the same: the place of the sensor on its carrier [m]."""


@dataclass(frozen=True)
class Viewpoints:
    """Sensor positions by the headers of a folder.

    Attributes:
        poses: (4, 4) T_world_sensor by frame; empty if there are none, or all are the same.
        T_sensor_file: (4, 4) transform of the points of a file to the sensor's frame; empty if they are in it.
        notes: lines for the user.
    """

    poses: dict[int, Float64] = field(default_factory=dict)
    T_sensor_file: dict[int, Float64] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def viewpoints_of(files: Mapping[int, Path]) -> Viewpoints:
    """Poses of PCD files by frame. PCL leaves open in which frame the points are, so that the points decide."""
    heads = {i: _head(path) for i, path in files.items()}
    found = {i: T for i, head in heads.items() if (T := viewpoint_of(head)) is not None}
    if not found:
        return Viewpoints()
    poses = {i: found.get(i, np.eye(4)) for i in files}
    first = next(iter(poses.values()))
    moves = any(np.abs(T - first).max() > SAME_M for T in poses.values())
    in_world = _around_viewpoint(files, poses)
    frame = "the frame of the poses, and are turned into the sensor's" if in_world else "the sensor's frame"
    what = "poses are those of VIEWPOINT" if moves else "VIEWPOINT is the same in all files: no poses"
    T_sensor_file = {i: inverse(T) for i, T in poses.items()} if in_world else {}
    return Viewpoints(poses if moves else {}, T_sensor_file, (f"{what}; points are in {frame}",))


def _around_viewpoint(files: Mapping[int, Path], poses: Mapping[int, Float64]) -> bool:
    """Whether points lie around the sensor's place rather than around the origin of the file."""
    farthest = sorted(poses, key=lambda i: float(np.linalg.norm(poses[i][:2, 3])), reverse=True)[:JUDGED]
    votes = []
    for i in farthest:
        place = poses[i][:3, 3]
        if np.linalg.norm(place) < FAR_M:
            continue
        try:
            # relative to the place, with full precision
            xyz = read_pcd(files[i].read_bytes(), se3(np.eye(3), -place))[:, :3]
        except (OSError, CloudError):
            continue
        xyz = xyz[np.isfinite(xyz).all(axis=1)]
        around_place = np.median(np.linalg.norm(xyz, axis=1))
        around_origin = np.median(np.linalg.norm(xyz + place.astype(np.float32), axis=1))
        votes.append(bool(around_place < around_origin))
    return 2 * sum(votes) > len(votes)


def _head(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(MAX_HEADER_BYTES)
    except OSError:
        return b""
