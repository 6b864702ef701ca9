"""Scans and KITTI's files."""

import numpy as np

from modt.geometry import Camera
from modt.sources import kitti_calibration
from modt.sources.pose_file import read_poses
from modt.sources.recognise import open_scans
from modt.sources.scan_file import read_scan
from modt_evaluation.box_tracking import detections as boxes
from modt_evaluation.kitti_labels import read_labels
from modt_evaluation.truth_files import open_truth
from tests.fuzz.target import of_file, target, targets_of_files
from tests.modt_evaluation.test_truth_files import CUBOID, ITEM, LABEL, POSE
from tests.sources import layouts, point_clouds

PLY = ("binary_little_endian", "binary_big_endian", "ascii")
AB3DMOT = "0,2,296.0,160.7,452.1,288.4,9.8,1.5,1.6,3.7,-2.9,1.8,13.5,-1.6,-1.3\n"
TRACKLETS = ITEM.format(type="Car", first=1, poses="".join(POSE.format(y=y) for y in (8, 9)))
CAR = LABEL.format(type="Car", edges="0 0 9 9")
PLACES = "1 0 0 5 0 1 0 0 0 0 1 0\n" * 3
CAMERA = Camera(np.eye(3, 4), np.eye(4), 1242.0, 375.0)


def read_detections(path):
    for sequence in boxes.read([path]):
        list(sequence.frames())


def clouds(write, z, *encodings):
    rows = point_clouds.table(x="f4", y="f4", z=z, intensity="u1")
    return [write(rows, encoding) for encoding in encodings]


targets_of_files(
    {
        "scan": ("a.bin", read_scan, [layouts.scan(0).tobytes()]),
        "pcd": ("a.pcd", read_scan, clouds(point_clouds.pcd, "f4", "binary", "ascii", "binary_compressed")),
        "ply": ("a.ply", read_scan, clouds(point_clouds.ply, "f8", *PLY)),
        "oxts_records": (
            "0003.txt",
            lambda path: kitti_calibration.oxts_poses(kitti_calibration.read_oxts(path)),
            ["\n".join(layouts.oxts_line(2.0 * f) for f in range(3))],
        ),
        "poses": ("poses.txt", read_poses, [PLACES]),
        "labels_of_frame": ("labels.txt", lambda path: read_labels(path, CAMERA, tracking=False), [CAR * 2]),
        "detections": ("0003.txt", read_detections, [AB3DMOT * 2, f"0 -1 {CAR.strip()} 0.9\n" * 2]),
    }
)


@target()
def calibration_of_sequence(folder):
    path = folder / "0003.txt"

    def read():
        kitti_calibration.camera_of_sequence(path)
        kitti_calibration.T_imu_sensor_of_sequence(path)

    layouts.tracking(folder)
    return of_file(path, read, (folder / "training" / "calib" / "0003.txt").read_bytes())


@target()
def calibration_of_drive(folder):
    """All three files in one."""
    drive = layouts.raw_drive(folder)
    names = ("calib_cam_to_cam.txt", "calib_velo_to_cam.txt", "calib_imu_to_velo.txt")
    paths = [drive.parent / name for name in names]
    seeds = [path.read_bytes() for path in paths]

    def call(raw):
        for path, part in zip(paths, [*raw.split(b"---"), b"", b""], strict=False):
            path.write_bytes(part)
        kitti_calibration.camera_of_raw(paths[0])
        kitti_calibration.T_imu_sensor_of_raw(drive.parent)

    return [b"---".join(seeds)], call


@target()
def time_stamps(folder):
    """Time stamps of the sweeps, the same for their begin and their end."""
    drive = layouts.raw_drive(folder)
    points = drive / "velodyne_points"

    def call(raw):
        for name in ("timestamps.txt", "timestamps_start.txt", "timestamps_end.txt"):
            (points / name).write_bytes(raw)
        open_scans(drive)

    return [(points / "timestamps.txt").read_bytes()], call


@target()
def times_of_sequence(folder):
    sequence = layouts.odometry(folder)
    return of_file(sequence / "times.txt", lambda: list(open_scans(sequence)), "0.0\n0.104\n0.207\n")


@target()
def truth_of_drive(folder):
    drive = layouts.raw_drive(folder)
    seed = f"<root><tracklets>{TRACKLETS}</tracklets></root>"
    return of_file(drive / "tracklet_labels.xml", lambda: open_truth(drive), seed)


@target()
def truth_of_sequence(folder):
    scans = layouts.tracking(folder)
    path = scans.parents[1] / "label_02" / "0003.txt"
    path.parent.mkdir()
    other = LABEL.format(type="DontCare", edges="0 0 9 9")
    return of_file(path, lambda: open_truth(path, scans), f"0 4 {CAR}0 -1 {other}2 4 {CAR}")


@target()
def cuboids(folder):
    (folder / "poses.txt").write_text(PLACES)
    seed = CUBOID + "0,3,Car,9,1,0.5,2,1,1.5,0.1\n2,3,Car,9,1,0.5,2,1,1.5,0.1\n"
    return of_file(folder / "truth.csv", lambda: open_truth(folder), seed)
