"""Drift of ego-motion from the proposals, beside KISS-ICP's where that is installed (extra `kiss`).

    python -m tools.study.ego_drift DRIVE [DRIVE ...] [--frames A:B] [--no-kiss]

DRIVE is a KITTI raw drive, a recorded one or one of `modt simulate`. Each way is judged against two references: the
positions of the OXTS records, and the velocities of the same records, integrated over their time stamps. Errors are
those of the end: its place in percent of the way that the reference made, its heading in degrees. With several drives
the means of the magnitudes follow.
"""

from __future__ import annotations

import argparse
import json
from collections import defaultdict
from collections.abc import Iterable
from datetime import datetime
from pathlib import Path

import numpy as np

from modt import assembly
from modt.cli.replay import frames as frame_range
from modt.energy.ledger import NullLedger
from modt.geometry import FieldOfView, inverse, rotation_zyx, se3, yaw_of
from modt.profile import load
from modt.sources import kitti_calibration, oxts
from modt.sources.pose_source import NoOdometry, PosedStream
from modt.sources.recognise import open_stream
from modt.sources.stream import Stream
from modt.types import Float64

VN, VE, VU = 6, 7, 10
"""Columns of an OXTS record: velocities to the north, east and up [m/s]."""
KISS_RANGE_M = (2.0, 80.0)


def way_m(T: Float64) -> float:
    """Length of the way of poses (n, 4, 4) in the plane."""
    return float(np.linalg.norm(np.diff(T[:, :2, 3], axis=0), axis=1).sum())


def end_of(T: Float64) -> Float64:
    """(3,) x, y [m] and yaw [rad] of the last pose as seen from the first, both laid flat."""
    level = [se3(rotation_zyx(0, 0, yaw_of(P)), np.array([P[0, 3], P[1, 3], 0.0])) for P in T[[0, -1]]]
    moved = inverse(level[0]) @ level[1]
    return np.array([moved[0, 3], moved[1, 3], yaw_of(moved)])


def drift(estimate: Float64, reference: Float64) -> dict[str, float]:
    """How poses (n, 4, 4) differ from those of a reference: way and end in percent of its way, heading in degrees."""
    length = way_m(reference)
    error = end_of(estimate) - end_of(reference)
    return {
        "way_percent": 100 * (way_m(estimate) / length - 1),
        "end_percent": 100 * float(np.hypot(*error[:2])) / length,
        "heading_deg": float(np.rad2deg(np.angle(np.exp(1j * error[2])))),
    }


def by_proposals(stream: Stream, *, camera: bool) -> Float64:
    """(n, 4, 4) poses that the tracker finds without odometry."""
    profile, mode = load(), assembly.MODES["efficient"]
    assert stream.info.camera is not None
    fov = FieldOfView.of_camera(stream.info.camera) if camera else FieldOfView()
    pipeline = assembly.pipeline(mode, profile, fov, NullLedger())
    poses = []
    for frame in PosedStream(stream, NoOdometry()):
        pipeline.step(frame, mode.budget(profile))
        poses.append(pipeline.tracker.T_world_sensor)
    return np.array(poses)


def by_kiss_icp(stream: Stream) -> Float64:
    """(n, 4, 4) poses of KISS-ICP on the whole sweeps, deskewed where their head took time to turn."""
    from kiss_icp.config import KISSConfig
    from kiss_icp.kiss_icp import KissICP

    config = KISSConfig()
    config.data.deskew = next(iter(stream)).turn_s != 0.0
    config.data.min_range, config.data.max_range = KISS_RANGE_M
    config.mapping.voxel_size = KISS_RANGE_M[1] / 100
    config.registration.max_num_threads = 1
    odometry, poses = KissICP(config), []
    for frame in stream:
        xyz = frame.points[:, :3].astype(np.float64)
        # From 0 to 1 over the sweep, seam to seam behind the sensor.
        when = 0.5 - np.copysign(1.0, frame.turn_s) * np.arctan2(xyz[:, 1], xyz[:, 0]) / (2 * np.pi)
        odometry.register_frame(xyz, when if config.data.deskew else np.zeros(0))
        poses.append(odometry.last_pose.copy())
    return np.array(poses)


def integrated(drive: Path, indices: Iterable[int]) -> Float64:
    """(n, 4, 4) sensor poses of frames: the records' velocities integrated, with the records' attitudes."""
    folder = drive / "oxts"
    records = np.array([oxts.read_record(folder / "data" / f"{i:010d}.txt") for i in indices])
    texts = (folder / "timestamps.txt").read_text(encoding="ascii").splitlines()
    stamps = [datetime.fromisoformat(texts[i][:26]) for i in indices]
    step_s = np.diff([(s - stamps[0]).total_seconds() for s in stamps])
    velocity = records[:, [VE, VN, VU]]
    place = np.vstack([np.zeros(3), np.cumsum((velocity[1:] + velocity[:-1]) / 2 * step_s[:, None], axis=0)])
    T_imu_sensor = kitti_calibration.T_imu_sensor_of_raw(drive.parent)
    poses = zip(records[:, 3:6], place, strict=True)
    return np.array([se3(rotation_zyx(*angles), at) @ T_imu_sensor for angles, at in poses])


def has_kiss_icp() -> bool:
    """Whether the extra is installed."""
    try:
        import kiss_icp  # noqa: F401
    except ImportError:
        return False
    return True


def study(drive: Path, span: tuple[int, int | None], *, kiss: bool) -> dict[str, dict[str, float]]:
    """Drift of every estimate against every reference, by their names."""
    stream = open_stream(drive).between(*span)
    poses = [(s.index, s.T_world_sensor) for s in stream.scans if s.T_world_sensor is not None]
    references = {
        "positions": np.array([T for _, T in poses]),
        "velocities": integrated(drive, [i for i, _ in poses]),
    }
    estimates = {f"proposals, {fov}": by_proposals(stream, camera=fov == "camera") for fov in ("full", "camera")}
    if kiss:
        estimates["KISS-ICP"] = by_kiss_icp(stream)
    out = {f"OXTS {name}": {"way_m": way_m(T)} for name, T in references.items()}
    for name, T in estimates.items():
        out[name] = {"way_m": way_m(T)}
        for against, reference in references.items():
            out[f"{name} against OXTS {against}"] = drift(T, reference)
        if kiss and name != "KISS-ICP":
            out[f"{name} against KISS-ICP"] = drift(T, estimates["KISS-ICP"])
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("drives", type=Path, nargs="+", metavar="DRIVE")
    parser.add_argument("--frames", type=frame_range, default=(0, None), metavar="A:B")
    parser.add_argument("--no-kiss", action="store_true", help="leave KISS-ICP out")
    arguments = parser.parse_args()
    kiss = has_kiss_icp() and not arguments.no_kiss
    if not kiss:
        print("KISS-ICP is left out" + ("" if arguments.no_kiss else ": pip install 'modt[kiss]' to compare with it"))
    magnitudes: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    for drive in arguments.drives:
        print(drive)
        for name, figures in study(drive.resolve(), arguments.frames, kiss=kiss).items():
            print(f"  {name:<42}", json.dumps({k: round(v, 3) for k, v in figures.items()}), flush=True)
            for key, value in figures.items():
                magnitudes[name][key].append(abs(value))
    if len(arguments.drives) > 1:
        print(f"means over {len(arguments.drives)} drives")
        for name, columns in magnitudes.items():
            print(f"  {name:<42}", json.dumps({k: round(float(np.mean(v)), 3) for k, v in columns.items()}))


if __name__ == "__main__":
    main()
