"""Recognition of layouts, and notes on missing files."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from modt.errors import MisuseError, ModtError
from modt.sources.recognise import open_stream
from modt.sources.stream import MAX_KEPT_FAULTS

from . import layouts


@pytest.mark.parametrize(
    ("build", "inner", "layout", "poses", "turn_s", "position"),
    [
        (layouts.raw_drive, ".", "KITTI raw drive", True, 0.1, None),
        (layouts.raw_drive, "velodyne_points", "KITTI raw drive", True, 0.1, None),
        (layouts.raw_drive, "velodyne_points/data", "KITTI raw drive", True, 0.1, None),
        (layouts.tracking, ".", "KITTI tracking", True, 0.1, [0, 4, 0]),
        (layouts.odometry, ".", "KITTI odometry", True, 0.0, [6, 0, 0]),
        (layouts.odometry, "velodyne", "KITTI odometry", True, 0.0, [6, 0, 0]),
        (layouts.bare, ".", "folder of scans", False, 0.0, None),
    ],
)
def test_each_layout_is_recognised(tmp_path, build, inner, layout, poses, turn_s, position):
    stream = open_stream(build(tmp_path) / inner)
    assert (stream.info.layout, stream.info.has_poses, stream.info.camera is not None) == (layout, poses, poses)
    assert stream.info.sequence == (3 if build is layouts.tracking else 0)
    frames = list(stream)
    assert [f.index for f in frames] == list(range(len(frames)))
    assert all((f.T_world_sensor is not None) is poses for f in frames)
    assert_allclose([f.turn_s for f in frames], turn_s, atol=1e-9)
    if position is not None:
        assert_allclose(frames[2].T_world_sensor[:3, 3], position, atol=1e-4)


EVEN = [0, 0.1, 0.2, 0.3]
TURNS = [0.1] * 4


@pytest.mark.parametrize(
    ("end", "edit", "stamps_s", "turns_s", "notes"),
    [
        ("", lambda lines: lines, EVEN, TURNS, []),
        ("_end", lambda lines: [*lines[:1], lines[1].replace("25.150000000", "25.151234567"), *lines[2:]],
         EVEN, [0.1, 0.101234567, 0.1, 0.1], []),
        ("_start", lambda _: ["nonsense"], EVEN, [0] * 4, ["no list of time stamps: .*not deskewed"]),
        ("_end", lambda _: ["", ""], EVEN, [0] * 4, ["no list of time stamps: .*not deskewed"]),
        ("_end", lambda _: ["2011-09-26 13:02:25.250000001"] * 4, EVEN, [0] * 4,
         ["2 sweeps of .*the first is 0.*not deskewed"]),
        *(("_end", lambda lines, blank=blank: [lines[0], blank, *lines[2:]], EVEN, [0.1, 0, 0.1, 0.1],
           [r"1 frames have no time in .* \(the first is 1\): sweeps are not deskewed"])
          for blank in ("  ", "25.05 nonsense")),
        ("", lambda lines: ["", lines[1], "", lines[3].replace("25.3", "25.31")], [0, 0.105, 0.21, 0.315], TURNS,
         [r"2 frames have no time in .* \(the first is 0\): theirs are interpolated"]),
        ("", lambda lines: lines[:3], EVEN, TURNS,
         ["has 3 lines, the last scan is number 3.*restore", r"1 frames have no time .*\(the first is 3\)"]),
        ("", lambda lines: lines[::-1], EVEN, TURNS, ["time stamps decrease: frames 0.1 s apart instead"]),
        ("_start", lambda lines: [*lines, lines[3]], EVEN, TURNS, ["has 5 lines, the last scan is number 3"]),
    ],
)  # fmt: skip
def test_lists_of_times_are_used_as_far_as_they_go(tmp_path, end, edit, stamps_s, turns_s, notes):
    drive = layouts.raw_drive(tmp_path)
    path = drive / "velodyne_points" / f"timestamps{end}.txt"
    path.write_text("\n".join(edit(path.read_text().splitlines())) + "\n")
    stream = open_stream(drive)
    assert_allclose([f.stamp_s for f in stream], stamps_s, atol=1e-9)
    assert_allclose([f.turn_s for f in stream], turns_s, atol=1e-9)
    assert len(stream.info.notes) == len(notes)
    for note, cause in zip(stream.info.notes, notes, strict=True):
        assert re.search(cause, note)


@pytest.mark.parametrize("end", ["", "_start", "_end"])
def test_missing_frames_leave_gaps_and_a_note_and_their_times_may_be_blank(tmp_path, end):
    drive = layouts.raw_drive(tmp_path, [0, 1, 4])
    path = drive / "velodyne_points" / f"timestamps{end}.txt"
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:2], "", "", lines[4]]))
    stream = open_stream(drive)
    assert [f.index for f in stream] == [0, 1, 4]
    assert_allclose([f.stamp_s for f in stream], [0, 0.1, 0.4], atol=1e-9)
    assert_allclose([f.turn_s for f in stream], 0.1, atol=1e-9)
    (note,) = stream.info.notes
    assert "2 frames are missing" in note


DAY = "2011_09_26"
DRIVE = "2011_09_26/2011_09_26_drive_9999_sync"


def emptied(path):
    path.write_text("")


GONE = [Path.unlink, emptied]


def without(row):
    """A function that removes a row from a calibration."""

    def edit(path):
        lines = path.read_text().splitlines(keepends=True)
        path.write_text("".join(line for line in lines if line.replace(":", " ").split()[0] != row))

    return edit


@pytest.mark.parametrize(
    ("build", "files", "edits", "named"),
    [
        (layouts.raw_drive, f"{DAY}/calib_cam_to_cam.txt", [*GONE, without("P_rect_02")], "no camera"),
        (layouts.raw_drive, f"{DAY}/calib_velo_to_cam.txt", [*GONE, without("T")], "no camera"),
        (layouts.raw_drive, f"{DAY}/calib_imu_to_velo.txt", [*GONE, without("R")], "no odometry"),
        (layouts.raw_drive, f"{DRIVE}/oxts/data/*.txt", GONE, "no odometry"),
        (layouts.raw_drive, f"{DRIVE}/velodyne_points/timestamps.txt", GONE, "0.1 s apart"),
        (layouts.raw_drive, f"{DRIVE}/velodyne_points/timestamps_start.txt", GONE, "not deskewed"),
        (layouts.raw_drive, f"{DRIVE}/velodyne_points/timestamps_end.txt", GONE, "not deskewed"),
        (layouts.odometry, "sequences/07/times.txt", GONE, "0.1 s apart"),
        (layouts.odometry, "sequences/07/poses.txt", GONE, "no odometry"),
        (layouts.odometry, "sequences/07/calib.txt", [*GONE, without("P2")], "no camera"),
        (layouts.odometry, "sequences/07/calib.txt", [without("Tr")], "get Tr from data_odometry_calib.zip"),
        (layouts.tracking, "training/oxts/0003.txt", GONE, "no odometry"),
        (layouts.tracking, "training/calib/0003.txt", [*GONE, without("Tr_velo_cam")], "no camera"),
        (layouts.tracking, "training/calib/0003.txt", [without("R_rect")], None),
        (layouts.tracking, "training/calib/0003.txt", [without("Tr_imu_velo")], "no odometry"),
    ],
)
def test_missing_files_and_rows_are_noted_and_the_stream_works(tmp_path, build, files, edits, named):
    for k, edit in enumerate(edits):
        root = build(tmp_path / str(k))
        for path in list((tmp_path / str(k)).glob(files)):
            edit(path)
        stream = open_stream(root)
        notes = (*stream.info.notes, *stream.info.pose_notes)
        assert (notes == ()) if named is None else any(named in note for note in notes), notes
        assert named is None or "*" in files or any(files.rsplit("/", 1)[1] in note for note in notes), notes
        assert len(list(stream)) >= 3


@pytest.mark.parametrize(
    ("file", "text", "cause"),
    [
        ("2011_09_26/calib_velo_to_cam.txt", "R: 1 2 3\n", r"calib_velo_to_cam.*R holds 3 numbers"),
        (f"{DRIVE}/oxts/data/0000000002.txt", "49.0 8.4 nonsense", r"0000000002\.txt"),
        (f"{DRIVE}/velodyne_points", None, "velodyne_points"),
    ],
)
def test_a_broken_part_is_an_error_with_its_file(tmp_path, file, text, cause):
    drive = layouts.raw_drive(tmp_path)
    shutil.rmtree(tmp_path / file) if text is None else (tmp_path / file).write_text(text)
    with pytest.raises(MisuseError, match=cause):
        open_stream(drive)


@pytest.mark.parametrize(
    ("times", "notes"),
    [
        ("0.000000e+00 1.000000e-01 2.100000e-01", 0),
        ("1317384506.40 1317384506.50 1317384506.61", 0),
        ("1317384506400 1317384506500 1317384506610", 0),
        ("1317384506400000000 1317384506500000000 1317384506610000000", 0),
        ("0.0 nan 0.21", 1),
    ],
)
def test_times_of_an_odometry_sequence_are_seconds_or_units_since_1970(tmp_path, times, notes):
    sequence = layouts.odometry(tmp_path)
    (sequence / "times.txt").write_text("\n".join(times.split()))
    stream = open_stream(sequence)
    assert [f.stamp_s for f in stream] == pytest.approx([0, 0.105 if notes else 0.1, 0.21], abs=1e-6)
    assert len(stream.info.notes) == notes


def test_a_frame_without_a_pose_has_that_of_the_frame_before(tmp_path):
    drive = layouts.raw_drive(tmp_path)
    (drive / "oxts" / "data" / f"{2:010d}.txt").unlink()
    frames = list(open_stream(drive))
    assert_array_equal(frames[2].T_world_sensor, frames[1].T_world_sensor)
    assert not np.allclose(frames[3].T_world_sensor, frames[2].T_world_sensor)


def test_bad_scans_are_counted_and_skipped_bad_points_are_counted_and_the_first_of_them_logged(tmp_path, caplog):
    folder = layouts.bare(tmp_path)
    n = 3 * MAX_KEPT_FAULTS
    for k in range(n):
        scan = layouts.scan(k)
        scan[0, 0] = np.nan if k % 3 == 2 else 0.0
        (folder / f"{k:06d}.bin").write_bytes(scan.tobytes() + b"cut" * (k % 3 == 1))
    stream = open_stream(folder)
    assert [f.index for f in stream] == [k for k in range(n) if k % 3 != 1]
    assert (stream.faults.count, stream.faults.skipped) == (2 * MAX_KEPT_FAULTS, MAX_KEPT_FAULTS)
    kept = [(k, k % 3 == 1) for k in range(n) if k % 3][:MAX_KEPT_FAULTS]
    assert [(f.frame, f.skipped) for f in stream.faults.first] == kept
    assert len(caplog.records) == MAX_KEPT_FAULTS
    assert "only counted" in caplog.records[-1].getMessage()
    for path in folder.glob("*.bin"):
        path.write_bytes(b"")
    with pytest.raises(ModtError, match=f"none of its {n} scans"):
        list(open_stream(folder))


@pytest.mark.parametrize(
    ("make", "cause"),
    [
        (lambda root: root / "nowhere", "no such file"),
        (lambda root: root, "no stream"),
        (lambda root: (root / "a.bin").write_bytes(b"") or root / "a.bin", "no stream"),
        (lambda root: layouts.raw_drive(root).parent.parent, "a stream further down.*drive_9999"),
    ],
    ids=["missing", "empty", "a file", "a root"],
)
def test_a_path_without_a_stream_is_refused(tmp_path, make, cause):
    with pytest.raises(MisuseError, match=cause):
        open_stream(make(tmp_path))


@pytest.mark.parametrize(
    ("name", "cause"),
    [
        ("a.bag", r"ROS 1; pip install rosbags; rosbags-convert --src FILE"),
        ("a.LAS", r"LAS file; convert it: pdal translate"),
        ("a.npy", r"array of NumPy; convert it: numpy.load"),
        ("a.xyz", r"table of text; convert it: numpy.loadtxt"),
        ("a.osf", r"Ouster's SDK; convert it: ouster-cli"),
        ("a.lvx2", r"Livox Viewer; record the packets instead: tcpdump"),
    ],
)
def test_a_known_file_that_is_not_read_is_one_line_with_its_conversion(tmp_path, name, cause):
    path = tmp_path / "drive" / name
    path.parent.mkdir()
    path.write_bytes(b"x")
    for given in (path, path.parent):
        with pytest.raises(MisuseError, match=cause) as refused:
            open_stream(given)
        assert "\n" not in str(refused.value)
    (path.parent / "000000.bin").write_bytes(np.ones((9, 4), np.float32).tobytes())
    assert open_stream(path.parent).info.n_frames == 1
