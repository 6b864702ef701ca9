"""Scenes of nuScenes: the tables of version 1.0, and the sweeps of LIDAR_TOP that they name."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from modt.errors import MisuseError
from modt.geometry import rotation_of, se3
from modt.sources.scan_file import ScanReference, ScanStream
from modt.sources.stream import StreamInfo
from modt.types import Float64

CHANNEL = "LIDAR_TOP"
REMEDY = "restore the tables, or give the folder that holds v1.0-*, samples and sweeps"
T_LIDAR_SENSOR = se3(np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.zeros(3))
"""Transform from x forward, y left to nuScenes' x right, y forward."""
Row = dict[str, Any]


@dataclass(frozen=True)
class Scene:
    """A scene of a data set.

    Attributes:
        tables: folder of the tables.
        name: name of the scene.
        sweeps: its rows of sample_data that are sweeps of LIDAR_TOP and whose files exist, by time.
        vehicles, poses: (4, 4) poses of the vehicle and T_world_sensor of each sweep.
        missing: number of its sweeps whose files do not exist.
    """

    tables: Path
    name: str
    sweeps: tuple[Row, ...]
    vehicles: tuple[Float64, ...]
    poses: tuple[Float64, ...]
    missing: int

    def sample_of_frame(self) -> dict[int, str]:
        """Token of the sample of each frame that is a key frame."""
        return {i: row["sample_token"] for i, row in enumerate(self.sweeps) if row["is_key_frame"]}


def tables_of(path: Path) -> tuple[Path, str] | None:
    """Folder of the tables, and name of the scene, at DATA[/v1.0-*][/SCENE]; no name stands for the only scene.

    None if nothing there is a data set.
    """
    for data, name in ((path, ""), (path.parent, path.name)):
        if name and path.exists():
            return None
        versions = (
            [data] if (data / "scene.json").is_file() else sorted(p.parent for p in data.glob("v1.0-*/scene.json"))
        )
        if versions:
            return _version(versions, name), name
    return None


def open_scene(tables: Path, name: str) -> ScanStream:
    """Stream of a scene, whose sweeps are compensated for the motion of the sensor.

    Raises:
        MisuseError: no such scene, several of them without a name, no sweeps, or a table is broken.
    """
    scene = read_scene(tables, name)
    times_us = [int(row["timestamp"]) for row in scene.sweeps]
    gaps_s = [(b - a) * 1e-6 for a, b in pairwise(times_us)]
    data = tables.parent
    scans = [
        ScanReference(i, data / row["filename"], (time_us - times_us[0]) * 1e-6, T)
        for i, (row, time_us, T) in enumerate(zip(scene.sweeps, times_us, scene.poses, strict=True))
    ]
    notes = [f"{scene.missing} sweeps of {scene.name} are not in {data}"] if scene.missing else []
    info = StreamInfo(
        scene.name,
        "nuScenes scene",
        period_s=round(median(gaps_s), 3) if gaps_s else 0.5,
        has_poses=True,
        notes=tuple(notes),
        profile="hdl-32e",
    )
    return ScanStream(info, scans)


@lru_cache(maxsize=2)
def read_scene(tables: Path, name: str) -> Scene:
    """A scene by its name; the only one without a name.

    Raises:
        MisuseError: as `open_scene`.
    """
    try:
        return _scene(tables, name)
    except (KeyError, TypeError, ValueError) as error:
        raise MisuseError(tables, f"its tables do not fit together ({error!r})", REMEDY) from None


def _scene(tables: Path, name: str) -> Scene:
    scenes = {row["name"]: row for row in read_table(tables, "scene", "name", "token")}
    if name not in scenes and (name or len(scenes) != 1):
        known = ", ".join(sorted(scenes)[:10]) + (" …" if len(scenes) > 10 else "")
        cause = f"no scene {name}" if name else f"holds {len(scenes)} scenes"
        raise MisuseError(tables.parent, cause, f"append one: {tables.parent}/SCENE of {known}")
    scene = scenes[name] if name else next(iter(scenes.values()))
    samples = read_table(tables, "sample", "token", "scene_token")
    wanted = {row["token"] for row in samples if row["scene_token"] == scene["token"]}
    lidars = {row["token"] for row in read_table(tables, "sensor", "token", "channel") if row["channel"] == CHANNEL}
    mounts = read_table(tables, "calibrated_sensor", "token", "sensor_token", "translation", "rotation")
    mount_of = {row["token"]: row for row in mounts if row["sensor_token"] in lidars}
    columns = ("sample_token", "calibrated_sensor_token", "ego_pose_token", "timestamp", "filename", "is_key_frame")
    rows = read_table(tables, "sample_data", *columns)
    own = [row for row in rows if row["sample_token"] in wanted and row["calibrated_sensor_token"] in mount_of]
    there = sorted((row for row in own if (tables.parent / row["filename"]).is_file()), key=lambda r: r["timestamp"])
    if not there:
        raise MisuseError(
            tables.parent, f"no sweeps of {scene['name']}", "unpack samples (and sweeps) beside the tables"
        )
    used = {row["ego_pose_token"] for row in there}
    poses = read_table(tables, "ego_pose", "token", "translation", "rotation")
    pose_of = {row["token"]: placement(row) for row in poses if row["token"] in used}
    mounts_of = {token: placement(row) @ T_LIDAR_SENSOR for token, row in mount_of.items()}
    vehicles = tuple(pose_of[row["ego_pose_token"]] for row in there)
    mounts_used = (mounts_of[row["calibrated_sensor_token"]] for row in there)
    placed = tuple(vehicle @ mount for vehicle, mount in zip(vehicles, mounts_used, strict=True))
    return Scene(tables, scene["name"], tuple(there), vehicles, placed, len(own) - len(there))


def placement(row: Row) -> Float64:
    """(4, 4) transform of a row with a translation [m] and a rotation (quaternion w, x, y, z).

    Raises:
        TypeError, ValueError: they are none.
    """
    w, *xyz = map(float, row["rotation"])
    if not any((w, *xyz)):
        raise ValueError("no rotation")
    place = np.array([*xyz, w, *map(float, row["translation"])])
    if not np.isfinite(place).all():
        raise ValueError("not finite")
    return se3(rotation_of(place[:4]), place[4:].reshape(3))


def read_table(tables: Path, name: str, *columns: str) -> list[Row]:
    """Rows of a table, each with these columns.

    Raises:
        MisuseError: it cannot be read, or lacks a column.
    """
    path = tables / f"{name}.json"
    try:
        rows = json.loads(path.read_bytes())
        for row in rows:
            for column in columns:
                row[column]
    except (OSError, ValueError, TypeError, KeyError, RecursionError) as error:
        raise MisuseError(path, f"is no table of {name} ({error})", REMEDY) from None
    return list(rows)


def _version(versions: list[Path], name: str) -> Path:
    if len(versions) == 1:
        return versions[0]
    listed = ", ".join(str(version / name) for version in versions)
    raise MisuseError(versions[0].parent, "holds several versions of nuScenes", f"give one: {listed}")
