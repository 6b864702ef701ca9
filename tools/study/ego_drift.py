"""Drift of ego-motion estimated from proposals, compared with KISS-ICP where installed (extra `kiss`).

    python -m tools.study.ego_drift DRIVE [DRIVE ...] [--frames A:B]

DRIVE is a KITTI raw drive, recorded or written by `modt simulate`. Each estimate is compared with the positions
of the OXTS records and with their velocities, integrated over time. The errors are those of the last pose, with the
position in percent of the reference's path length and the heading in degrees. For several drives, means of the
magnitudes follow.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterable
from datetime import datetime
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from modt.cli.options import frames as frame_range
from modt.geometry import FieldOfView, inverse, rotation_zyx, se3, yaw_of
from modt.poses.pose_source import NoPoses
from modt.profile import load
from modt.sources import kitti_calibration
from modt.sources.recognise import open_scans
from modt.sources.stream import Stream
from modt.types import Float64
from tools.options import parser
from tools.study.drives import steps_of

VN = 6
"""Column of an OXTS record: velocity to the north [m/s]."""
VE = 7
"""Column of an OXTS record: velocity to the east [m/s]."""
VU = 10
"""Column of an OXTS record: velocity up [m/s]."""
KISS_RANGE_M = (2.0, 80.0)


def path_m(T: Float64) -> float:
    """Path length of poses (n, 4, 4) in the plane."""
    return float(np.linalg.norm(np.diff(T[:, :2, 3], axis=0), axis=1).sum())


def end_of(T: Float64) -> Float64:
    """(3,) x, y [m] and yaw [rad] of the last pose relative to the first, without roll and pitch."""
    level = [se3(rotation_zyx(0, 0, yaw_of(P)), np.array([P[0, 3], P[1, 3], 0.0])) for P in T[[0, -1]]]
    moved = inverse(level[0]) @ level[1]
    return np.array([moved[0, 3], moved[1, 3], yaw_of(moved)])


def drift(estimate: Float64, reference: Float64) -> dict[str, float]:
    """Errors of poses (n, 4, 4): path length and last position in percent of the path, last heading in degrees."""
    length = path_m(reference)
    error = end_of(estimate) - end_of(reference)
    return {
        "path_percent": 100 * (path_m(estimate) / length - 1),
        "end_percent": 100 * float(np.hypot(*error[:2])) / length,
        "heading_deg": float(np.rad2deg(np.angle(np.exp(1j * error[2])))),
    }


def by_proposals(stream: Stream, *, camera: bool) -> Float64:
    """(n, 4, 4) poses estimated from proposals, without odometry."""
    assert stream.info.camera is not None
    fov = FieldOfView.of_camera(stream.info.camera) if camera else FieldOfView()
    step = steps_of("efficient", load(), fov)
    return np.array([step(frame).T_world_sensor for frame in map(NoPoses().place, stream)])


def by_kiss_icp(stream: Stream) -> Float64:
    """(n, 4, 4) poses of KISS-ICP on full sweeps, deskewed if they are not compensated."""
    from kiss_icp.config import KISSConfig
    from kiss_icp.kiss_icp import KissICP

    config = KISSConfig()
    config.data.deskew = next(iter(stream)).turn_s != 0.0
    config.data.min_range, config.data.max_range = KISS_RANGE_M
    config.mapping.voxel_size = KISS_RANGE_M[1] / 100
    config.registration.max_num_threads = 1
    odometry = KissICP(config)
    poses = []
    for frame in stream:
        xyz = frame.points[:, :3].astype(np.float64)
        # Firing time, 0 to 1 over the sweep; the sweep begins and ends behind the sensor.
        time = 0.5 - np.copysign(1.0, frame.turn_s) * np.arctan2(xyz[:, 1], xyz[:, 0]) / (2 * np.pi)
        odometry.register_frame(xyz, time if config.data.deskew else np.zeros(0))
        poses.append(odometry.last_pose.copy())
    return np.array(poses)


def integrated(drive: Path, indices: Iterable[int]) -> Float64:
    """(n, 4, 4) sensor poses from the integrated velocities and the attitudes of the records."""
    folder = drive / "oxts"
    records = np.concatenate([kitti_calibration.read_oxts(folder / "data" / f"{i:010d}.txt")[:1] for i in indices])
    texts = (folder / "timestamps.txt").read_text(encoding="ascii").splitlines()
    stamps = [datetime.fromisoformat(texts[i][:26]) for i in indices]
    step_s = np.diff([(s - stamps[0]).total_seconds() for s in stamps])
    velocity = records[:, [VE, VN, VU]]
    place = np.vstack([np.zeros(3), np.cumsum((velocity[1:] + velocity[:-1]) / 2 * step_s[:, None], axis=0)])
    T_imu_sensor = kitti_calibration.T_imu_sensor_of_raw(drive.parent)
    poses = zip(records[:, 3:6], place, strict=True)
    return np.array([se3(rotation_zyx(*angles), at) @ T_imu_sensor for angles, at in poses])


def study(drive: Path, span: tuple[int, int | None]) -> dict[str, dict[str, float]]:
    """Drift of each estimate against each reference, by name."""
    stream = open_scans(drive).between(*span)
    poses = [(s.index, s.T_world_sensor) for s in stream.scans if s.T_world_sensor is not None]
    references = {
        "positions": np.array([T for _, T in poses]),
        "velocities": integrated(drive, [i for i, _ in poses]),
    }
    estimates = {f"proposals, {fov}": by_proposals(stream, camera=fov == "camera") for fov in ("full", "camera")}
    if find_spec("kiss_icp"):
        estimates["KISS-ICP"] = by_kiss_icp(stream)
    out = {f"OXTS {name}": {"path_m": path_m(T)} for name, T in references.items()}
    for name, T in estimates.items():
        out[name] = {"path_m": path_m(T)}
        for against, reference in references.items():
            out[f"{name} against OXTS {against}"] = drift(T, reference)
    return out


def main() -> None:
    options = parser(__doc__)
    options.add_argument("drives", type=Path, nargs="+", metavar="DRIVE")
    options.add_argument("--frames", type=frame_range, default=(0, None), metavar="A:B")
    arguments = options.parse_args()
    if not find_spec("kiss_icp"):
        print("without KISS-ICP: not installed; pip install '.[kiss]'")
    magnitudes: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    for drive in arguments.drives:
        print(drive)
        for name, figures in study(drive.resolve(), arguments.frames).items():
            print(f"  {name:<42}", json.dumps({k: round(v, 3) for k, v in figures.items()}), flush=True)
            for key, value in figures.items():
                magnitudes[name][key].append(abs(value))
    if len(arguments.drives) > 1:
        print(f"means over {len(arguments.drives)} drives")
        for name, columns in magnitudes.items():
            print(f"  {name:<42}", json.dumps({k: round(float(np.mean(v)), 3) for k, v in columns.items()}))


if __name__ == "__main__":
    main()
