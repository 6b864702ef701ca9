"""Small streams of every layout, for tests."""

import numpy as np

CAMERA = {
    "P": "100 0 100 0 0 100 50 0 0 0 1 0",
    "R": "1 0 0 0 1 0 0 0 1",
    "Tr": "0 -1 0 0 0 0 -1 0 1 0 0 0",
}
OXTS_START = (49.0, 8.4, 110.0, 0.0, 0.0, 0.0)


def scan(frame, n=50):
    rng = np.random.default_rng(frame)
    points = rng.uniform(-20, 20, (n, 4)).astype(np.float32)
    points[:, 3] = rng.uniform(0, 1, n)
    return points


def write_scans(folder, frames, digits=6):
    folder.mkdir(parents=True)
    for f in frames:
        (folder / f"{f:0{digits}d}.bin").write_bytes(scan(f).tobytes())
    return folder


def oxts_line(metres_north):
    lat = OXTS_START[0] + np.rad2deg(metres_north / 6378137.0)
    return " ".join(map(str, (lat, *OXTS_START[1:], *[0.0] * 24)))


def raw_drive(root, frames=range(4)):
    day = root / "2011_09_26"
    drive = day / "2011_09_26_drive_9999_sync"
    write_scans(drive / "velodyne_points" / "data", frames, digits=10)
    for end, later in (("", 0.0), ("_start", -0.05), ("_end", 0.05)):  # the head turns once in 0.1 s
        times = "".join(f"2011-09-26 13:02:{25 + f / 10 + later:012.9f}\n" for f in range(max(frames) + 1))
        (drive / "velodyne_points" / f"timestamps{end}.txt").write_text(times)
    (day / "calib_cam_to_cam.txt").write_text(
        f"calib_time: 09-Jan-2012\nS_rect_02: 200 100\nR_rect_00: {CAMERA['R']}\nP_rect_02: {CAMERA['P']}\n"
    )
    (day / "calib_velo_to_cam.txt").write_text("R: 0 -1 0 0 0 -1 1 0 0\nT: 0 0 0\n")
    (day / "calib_imu_to_velo.txt").write_text(f"R: {CAMERA['R']}\nT: -0.8 0.3 -0.8\n")
    (drive / "oxts" / "data").mkdir(parents=True)
    for f in range(max(frames) + 1):
        (drive / "oxts" / "data" / f"{f:010d}.txt").write_text(oxts_line(1.0 * f))
    return drive


def tracking(root):
    scans = write_scans(root / "training" / "velodyne" / "0003", range(3))
    (root / "training" / "calib").mkdir()
    (root / "training" / "calib" / "0003.txt").write_text(
        f"P2: {CAMERA['P']}\nR_rect {CAMERA['R']}\nTr_velo_cam {CAMERA['Tr']}\nTr_imu_velo 1 0 0 0 0 1 0 0 0 0 1 0\n"
    )
    (root / "training" / "oxts").mkdir()
    (root / "training" / "oxts" / "0003.txt").write_text("\n".join(oxts_line(2.0 * f) for f in range(3)))
    return scans


def odometry(root):
    sequence = root / "sequences" / "07"
    write_scans(sequence / "velodyne", range(3))
    (sequence / "calib.txt").write_text(f"P2: {CAMERA['P']}\nTr: {CAMERA['Tr']}\n")
    (sequence / "times.txt").write_text("0.0\n0.104\n0.207\n")
    # The camera moves along its optical axis: forward.
    (sequence / "poses.txt").write_text("".join(f"1 0 0 0 0 1 0 0 0 0 1 {3 * f}\n" for f in range(3)))
    return sequence


def bare(root):
    return write_scans(root / "scans", range(3))
