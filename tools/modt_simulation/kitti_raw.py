"""Synthetic drives as a KITTI raw drive with tracklets and a SemanticKITTI sequence."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from modt.geometry import Camera, FieldOfView, inverse, se3, transform
from modt.types import Float64, Frame
from modt_simulation.simulator import Truth

HEADER = """<?xml version="1.0" encoding="UTF-8" standalone="yes" ?>
<!DOCTYPE boost_serialization>
<boost_serialization signature="serialization::archive" version="9">
<tracklets class_id="0" tracking_level="0" version="0">
"""
VISIBLE = 0
"""Tracklet code of occlusion of a body of enough points."""
LARGELY_OCCLUDED = 2
"""Tracklet code of occlusion of the other bodies."""
MIN_VISIBLE_POINTS = 20
"""Bodies of fewer points are annotated as largely occluded."""


@dataclass
class _Track:
    """A tracklet: its poses by frame begin with the first in view and may go beyond the last."""

    kind: str  # KITTI object type
    size: tuple[float, float, float]  # length, width, height [m]
    # foot [m], turns about x, y and z [rad], occlusion, truncation
    poses: dict[int, tuple[float, float, float, float, float, float, int, int]] = field(default_factory=dict)
    last_seen: int = 0  # last frame with points in view


class Tracklets:
    """Tracklets of a drive; a tracklet runs from the first frame with points of the body in view to the last."""

    def __init__(self, fov: FieldOfView) -> None:
        self.fov = fov
        self._tracks: dict[int, _Track] = {}

    def add(self, frame: int, truth: Truth) -> None:
        """Add the truth of one frame."""
        T_sensor_world = inverse(truth.T_world_sensor)
        foot = transform(T_sensor_world, truth.world_boxes[:, :3] - np.outer(truth.world_boxes[:, 5] / 2, [0, 0, 1]))
        yaw = truth.world_boxes[:, 6]
        turns = Rotation.from_matrix(T_sensor_world[:3, :3]) * Rotation.from_euler("z", yaw[:, None])
        poses = np.column_stack([foot, turns.as_euler("ZYX")[:, ::-1]])
        columns = (truth.bodies, truth.world_boxes, poses, truth.points, self.fov.depth(truth.boxes[:, :3]))
        for kind, body, box, pose, points, depth in zip(truth.kinds, *(c.tolist() for c in columns), strict=True):
            length, width, height = box[3:6]
            shown = depth > 0 and points > 0
            if shown and body not in self._tracks:
                self._tracks[body] = _Track(kind.name, (length, width, height))
            if body not in self._tracks:
                continue
            track = self._tracks[body]
            hidden = LARGELY_OCCLUDED if points < MIN_VISIBLE_POINTS else VISIBLE
            track.poses[frame] = (*pose, hidden, int(abs(depth) < length / 2))
            if shown:
                track.last_seen = frame

    def write(self, path: Path) -> None:
        """Write tracklet_labels.xml."""
        path.write_text("".join(self._lines()), encoding="ascii")

    def _lines(self) -> Iterator[str]:
        yield HEADER
        yield _elements(1, count=len(self._tracks), item_version=1)
        for track in self._tracks.values():
            poses = [(f, p) for f, p in sorted(track.poses.items()) if f <= track.last_seen]
            length, width, height = track.size
            yield "\t<item>\n"
            yield _elements(2, objectType=track.kind, h=f"{height:.6f}", w=f"{width:.6f}", l=f"{length:.6f}")
            yield _elements(2, first_frame=poses[0][0]) + "\t\t<poses>\n"
            yield _elements(3, count=len(poses), item_version=2)
            for _, (x, y, z, rx, ry, rz, occlusion, truncation) in poses:
                yield "\t\t\t<item>\n"
                yield _elements(4, tx=f"{x:.9f}", ty=f"{y:.9f}", tz=f"{z:.9f}")
                yield _elements(4, rx=f"{rx:.9f}", ry=f"{ry:.9f}", rz=f"{rz:.9f}", state=2)
                yield _elements(4, occlusion=occlusion, occlusion_kf=0, truncation=truncation)
                yield _elements(4, amt_occlusion=-1, amt_occlusion_kf=-1)
                yield _elements(4, amt_border_l=-1, amt_border_r=-1, amt_border_kf=-1)
                yield "\t\t\t</item>\n"
            yield "\t\t</poses>\n\t\t<finished>1</finished>\n\t</item>\n"
        yield "</tracklets>\n</boost_serialization>\n"


def _elements(depth: int, **texts: object) -> str:
    """XML elements of a name and a text, indented."""
    return "".join("\t" * depth + f"<{name}>{text}</{name}>\n" for name, text in texts.items())


DATE = "2020_01_01"
START = datetime(2020, 1, 1, 12)
ORIGIN_DEG = (49.0, 8.4)
"""Latitude and longitude of the origin of the world."""
EARTH_RADIUS_M = 6378137.0
T_SENSOR_IMU = se3(np.eye(3), np.array([-0.81, 0.32, -0.8]))
"""Mount of the inertial unit, as in KITTI's car."""
OXTS_FIELDS = 30
UInt32 = NDArray[np.uint32]


class DriveWriter:
    """Writes a raw drive DIR/DATE/DATE_drive_0000_sync and a sequence DIR/sequences/00.

    The scans of the sequence are hard links to those of the drive, copies where the file system has no links.
    `all_around` annotates every visible body, not only those in the camera's view.

    Raises:
        OSError: a file cannot be written.
    """

    def __init__(self, folder: Path, camera: Camera, *, all_around: bool = False) -> None:
        self.drive = folder / DATE / f"{DATE}_drive_0000_sync"
        self.sequence = folder / "sequences" / "00"
        self._scans = self.drive / "velodyne_points"
        self._oxts = self.drive / "oxts"
        for made in (self._scans / "data", self._oxts / "data", self.sequence / "velodyne", self.sequence / "labels"):
            made.mkdir(parents=True, exist_ok=True)
        _write_calibration(folder / DATE, camera)
        _write_sequence_calibration(self.sequence / "calib.txt", camera)
        self._camera = camera
        self._tracklets = Tracklets(FieldOfView() if all_around else FieldOfView.of_camera(camera))
        self._stamps: list[float] = []
        self._turns: list[float] = []
        self._poses: list[Float64] = []

    def write(self, frame: Frame, truth: Truth) -> None:
        """Write one frame."""
        assert frame.T_world_sensor is not None
        name = f"{frame.index:010d}"
        scan = self._scans / "data" / f"{name}.bin"
        frame.points.tofile(scan)
        copy = self.sequence / "velodyne" / f"{frame.index:06d}.bin"
        copy.unlink(missing_ok=True)
        try:
            os.link(scan, copy)
        except OSError:
            frame.points.tofile(copy)
        label(truth).tofile(self.sequence / "labels" / f"{frame.index:06d}.label")
        self._stamps.append(frame.stamp_s)
        self._turns.append(frame.turn_s)
        self._poses.append(frame.T_world_sensor)
        self._tracklets.add(frame.index, truth)

    def close(self) -> None:
        """Write poses, times and tracklets."""
        stamp_s = np.array(self._stamps)
        half_s = np.array(self._turns) / 2
        for path, times_s in (
            (self._scans / "timestamps.txt", stamp_s),
            (self._scans / "timestamps_start.txt", stamp_s - half_s),
            (self._scans / "timestamps_end.txt", stamp_s + half_s),
            (self._oxts / "timestamps.txt", stamp_s),
        ):
            path.write_text("".join(_time(s) for s in times_s.tolist()), encoding="ascii")
        for i, record in enumerate(oxts_records(np.array(self._poses), stamp_s)):
            text = " ".join(f"{v:.14g}" for v in record[:25]) + " 4 10 4 4 0\n"
            (self._oxts / "data" / f"{i:010d}.txt").write_text(text, encoding="ascii")
        (self.sequence / "times.txt").write_text("".join(f"{s:e}\n" for s in self._stamps), encoding="ascii")
        T_camera_sensor = self._camera.T_camera_sensor
        T_start = inverse(self._poses[0])
        chain = [T_camera_sensor @ T_start @ T @ inverse(T_camera_sensor) for T in self._poses]
        np.savetxt(self.sequence / "poses.txt", [T[:3].ravel() for T in chain], fmt="%.12e")
        self._tracklets.write(self.drive / "tracklet_labels.xml")


def label(truth: Truth) -> UInt32:
    """(N,) SemanticKITTI labels: class in the lower 16 bits, instance in the upper, 0 for none."""
    number = np.minimum(np.searchsorted(truth.bodies, truth.instance), len(truth.bodies) - 1)
    named = len(truth.bodies) > 0 and truth.bodies[number] == truth.instance
    instance = np.where(named, number + 1, 0).astype(np.uint32)
    return np.asarray((instance << np.uint32(16)) | truth.semantic.astype(np.uint32))


def oxts_records(T_world_sensor: Float64, stamp_s: Float64) -> Float64:
    """(n, 30) OXTS records of sensor poses (n, 4, 4): position, attitude and velocities; other fields are zero."""
    T = T_world_sensor @ T_SENSOR_IMU
    lat0, lon0 = np.deg2rad(ORIGIN_DEG)
    north0 = np.log(np.tan(np.pi / 4 + lat0 / 2))
    scale = np.cos(lat0)
    for _ in range(4):  # readers scale by the latitude of the first record, not by that of the origin
        lat = 2 * np.arctan(np.exp(north0 + T[:, 1, 3] / (scale * EARTH_RADIUS_M))) - np.pi / 2
        scale = np.cos(lat[0])
    lon = lon0 + T[:, 0, 3] / (scale * EARTH_RADIUS_M)
    yaw = np.arctan2(T[:, 1, 0], T[:, 0, 0])
    out = np.zeros((len(T), OXTS_FIELDS))
    out[:, :3] = np.stack([np.rad2deg(lat), np.rad2deg(lon), T[:, 2, 3] + 115.0], axis=1)
    out[:, 3] = np.arctan2(T[:, 2, 1], T[:, 2, 2])
    out[:, 4] = np.arcsin(np.clip(-T[:, 2, 0], -1, 1))
    out[:, 5] = yaw
    if len(T) > 1:
        east, north, up = np.gradient(T[:, :3, 3], stamp_s, axis=0).T
        out[:, [6, 7, 10]] = np.stack([north, east, up], axis=1)
        out[:, 8] = np.cos(yaw) * east + np.sin(yaw) * north
        out[:, 9] = np.cos(yaw) * north - np.sin(yaw) * east
        out[:, 19] = out[:, 22] = np.gradient(np.unwrap(yaw), stamp_s)
    return out


def _time(seconds: float) -> str:
    return f"{START + timedelta(seconds=seconds):%Y-%m-%d %H:%M:%S.%f}000\n"


def _row(values: Float64) -> str:
    return " ".join(f"{v:.12e}" for v in np.ravel(values))


def _projection(camera: Camera) -> Float64:
    return np.asarray(camera.P_image_sensor @ inverse(camera.T_camera_sensor))


def _write_calibration(folder: Path, camera: Camera) -> None:
    size = f"{camera.width_px:e} {camera.height_px:e}"
    lines = ["calib_time: 01-Jan-2020 12:00:00", "corner_dist: 9.950000e-02"]
    for k in range(4):
        lines += [
            f"S_{k:02d}: {size}",
            f"R_{k:02d}: {_row(np.eye(3))}",
            f"T_{k:02d}: {_row(np.zeros(3))}",
            f"S_rect_{k:02d}: {size}",
            f"R_rect_{k:02d}: {_row(np.eye(3))}",
            f"P_rect_{k:02d}: {_row(_projection(camera))}",
        ]
    (folder / "calib_cam_to_cam.txt").write_text("\n".join(lines) + "\n", encoding="ascii")
    for name, T in (("velo_to_cam", camera.T_camera_sensor), ("imu_to_velo", T_SENSOR_IMU)):
        text = f"calib_time: 01-Jan-2020 12:00:00\nR: {_row(T[:3, :3])}\nT: {_row(T[:3, 3])}\n"
        (folder / f"calib_{name}.txt").write_text(text, encoding="ascii")


def _write_sequence_calibration(path: Path, camera: Camera) -> None:
    rows = [f"P{k}: {_row(_projection(camera))}" for k in range(4)] + [f"Tr: {_row(camera.T_camera_sensor[:3])}"]
    path.write_text("\n".join(rows) + "\n", encoding="ascii")
