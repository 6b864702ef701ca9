"""Recognition of layouts, and notes on missing files."""

import re
import shutil

import numpy as np
import pytest

from modt.errors import MisuseError, ModtError
from modt.sources.pose_source import NoPoses
from modt.sources.recognise import open_stream
from modt.sources.stream import MAX_KEPT_FAULTS

from . import layouts
from .posed_stream import PosedStream


@pytest.mark.parametrize(
    ("build", "layout", "poses", "camera"),
    [
        (layouts.raw_drive, "KITTI raw drive", True, True),
        (layouts.tracking, "KITTI tracking", True, True),
        (layouts.odometry, "KITTI odometry", True, True),
        (layouts.bare, "folder of scans", False, False),
    ],
)
def test_each_layout_is_recognised(tmp_path, build, layout, poses, camera):
    stream = open_stream(build(tmp_path))
    assert stream.info.layout == layout
    assert stream.info.has_poses is poses
    assert (stream.info.camera is not None) is camera
    frames = list(stream)
    assert [f.index for f in frames] == list(range(len(frames)))
    assert all((f.T_world_sensor is not None) is poses for f in frames)


@pytest.mark.parametrize("inner", ["velodyne_points", "velodyne_points/data"])
def test_a_raw_drive_is_found_from_inside(tmp_path, inner):
    assert open_stream(layouts.raw_drive(tmp_path) / inner).info.layout == "KITTI raw drive"


def test_an_odometry_sequence_is_found_from_its_scans(tmp_path):
    assert open_stream(layouts.odometry(tmp_path) / "velodyne").info.layout == "KITTI odometry"


def test_odometry_poses_are_converted_to_sensor_poses(tmp_path):
    frames = list(open_stream(layouts.odometry(tmp_path)))
    np.testing.assert_allclose(frames[2].T_world_sensor[:3, 3], [6, 0, 0], atol=1e-12)
    assert frames[1].stamp_s == 0.104


@pytest.mark.parametrize(
    ("text", "stamps_s", "note"),
    [
        ("0.000000e+00\n1.040000e-01\n2.070000e-01\n", [0, 0.104, 0.207], None),
        ("1317384506.40\n1317384506.50\n1317384506.61\n", [0, 0.1, 0.21], None),
        ("1317384506400\n1317384506500\n1317384506610\n", [0, 0.1, 0.21], None),
        ("1317384506400000000\n1317384506500000000\n1317384506610000000\n", [0, 0.1, 0.21], None),
        ("", [0, 0.1, 0.2], "times.txt is empty: frames 0.1 s apart"),
        ("a b\nc d\n\n", [0, 0.1, 0.2], "times.txt is no list of time stamps"),
        ("0.0\nnan\n0.3\n", [0, 0.15, 0.3], "1 frames have no time in .*theirs are interpolated"),
        ("0.0\n0.15\n", [0, 0.15, 0.3], "times.txt has 2 lines, the last scan is number 2"),
    ],
    ids=["KITTI", "since 1970", "ms", "ns", "empty", "no numbers", "one is none", "short"],
)
def test_times_of_an_odometry_sequence_are_used_as_far_as_they_go(tmp_path, text, stamps_s, note):
    sequence = layouts.odometry(tmp_path)
    (sequence / "times.txt").write_text(text)
    stream = open_stream(sequence)
    assert [f.stamp_s for f in stream] == pytest.approx(stamps_s, abs=1e-6)
    assert bool(stream.info.notes) is (note is not None)
    assert note is None or re.search(note, stream.info.notes[0])


@pytest.mark.parametrize(
    ("build", "part"),
    [
        (layouts.odometry, "poses.txt"),
        (layouts.odometry, "calib.txt"),
        (layouts.tracking, "../../oxts/0003.txt"),
        (layouts.tracking, "../../calib/0003.txt"),
        (layouts.raw_drive, "velodyne_points/timestamps.txt"),
        (layouts.raw_drive, "oxts/data/*.txt"),
        (layouts.raw_drive, "../calib_imu_to_velo.txt"),
    ],
)
def test_an_empty_part_is_a_missing_one(tmp_path, build, part):
    root = build(tmp_path)
    for path in root.glob(part) if "*" in part else [root / part]:
        path.write_text("")
    stream = open_stream(root)
    assert len(list(stream)) > 2
    assert stream.info.notes + stream.info.pose_notes


def test_tracking_poses_come_from_oxts(tmp_path):
    stream = open_stream(layouts.tracking(tmp_path))
    assert stream.info.sequence == 3
    np.testing.assert_allclose(list(stream)[2].T_world_sensor[:3, 3], [0, 4, 0], atol=1e-4)


def test_stamps_count_from_the_first(tmp_path):
    stamps = [f.stamp_s for f in open_stream(layouts.raw_drive(tmp_path))]
    np.testing.assert_allclose(stamps, [0, 0.1, 0.2, 0.3], atol=1e-9)


@pytest.mark.parametrize(
    ("build", "turn_s"),
    [(layouts.raw_drive, 0.1), (layouts.tracking, 0.1), (layouts.odometry, 0.0), (layouts.bare, 0.0)],
)
def test_frames_have_the_duration_of_the_sweep(tmp_path, build, turn_s):
    stream = open_stream(build(tmp_path))
    np.testing.assert_allclose([f.turn_s for f in stream], turn_s, atol=1e-9)
    assert [f.turn_s for f in PosedStream(stream, NoPoses())] == [f.turn_s for f in stream]


def test_each_sweep_has_its_own_duration(tmp_path):
    drive = layouts.raw_drive(tmp_path)
    ends = drive / "velodyne_points" / "timestamps_end.txt"
    ends.write_text(ends.read_text().replace("25.150000000", "25.151234567"))
    np.testing.assert_allclose([f.turn_s for f in open_stream(drive)], [0.1, 0.101234567, 0.1, 0.1], atol=1e-12)


@pytest.mark.parametrize(
    ("end", "text", "named"),
    [
        ("start", "nonsense\n", "no list of time stamps"),
        ("end", "\n\n", "no list of time stamps"),
        ("end", "2011-09-26 13:02:24.000000000\n" * 4, "4 sweeps of .*the first is 0"),
        ("end", "2011-09-26 13:02:25.250000001\n" * 4, "2 sweeps of .*the first is 0"),
    ],
    ids=["broken", "blank", "backwards", "too long"],
)
def test_impossible_sweep_durations_are_noted_and_ignored(tmp_path, end, text, named):
    drive = layouts.raw_drive(tmp_path)
    (drive / "velodyne_points" / f"timestamps_{end}.txt").write_text(text)
    stream = open_stream(drive)
    (note,) = stream.info.notes
    assert re.search(named, note)
    assert note.endswith("not deskewed")
    assert [f.turn_s for f in stream] == [0.0] * 4


def lines_of(drive, end):
    """Path and lines of a list of times of a drive."""
    path = drive / "velodyne_points" / f"timestamps{end}.txt"
    return path, path.read_text().splitlines(keepends=True)


@pytest.mark.parametrize("end", ["_start", "_end"])
@pytest.mark.parametrize("blank", ["\n", "  \n", "25.05 nonsense\n"])
def test_a_sweep_without_times_is_not_deskewed_and_the_others_are(tmp_path, end, blank):
    drive = layouts.raw_drive(tmp_path)
    path, lines = lines_of(drive, end)
    path.write_text("".join([lines[0], blank, *lines[2:]]))
    stream = open_stream(drive)
    np.testing.assert_allclose([f.turn_s for f in stream], [0.1, 0, 0.1, 0.1], atol=1e-9)
    (note,) = stream.info.notes
    assert note == f"1 frames have no time in {path} (the first is 1): sweeps are not deskewed"


def test_a_missing_stamp_is_interpolated(tmp_path):
    drive = layouts.raw_drive(tmp_path)
    path, lines = lines_of(drive, "")
    path.write_text("".join(["\n", lines[1], "\n", lines[3].replace("25.3", "25.31")]))
    stream = open_stream(drive)
    np.testing.assert_allclose([f.stamp_s for f in stream], [0, 0.105, 0.21, 0.315], atol=1e-9)
    (note,) = stream.info.notes
    assert note == f"2 frames have no time in {path} (the first is 0): theirs are interpolated"


@pytest.mark.parametrize("end", ["", "_start", "_end"])
def test_blank_lines_of_missing_scans_are_valid(tmp_path, end):
    drive = layouts.raw_drive(tmp_path, [0, 1, 4])
    path, lines = lines_of(drive, end)
    path.write_text("".join([*lines[:2], "\n", "\n", lines[4]]))
    stream = open_stream(drive)
    np.testing.assert_allclose([f.stamp_s for f in stream], [0, 0.1, 0.4], atol=1e-9)
    np.testing.assert_allclose([f.turn_s for f in stream], 0.1, atol=1e-9)
    (note,) = stream.info.notes
    assert "2 frames are missing" in note


@pytest.mark.parametrize("end", ["", "_start", "_end"])
def test_a_list_of_another_length_is_noted_and_used_by_line(tmp_path, end):
    drive = layouts.raw_drive(tmp_path)
    path, lines = lines_of(drive, end)
    path.write_text("".join(lines[:3]))
    stream = open_stream(drive)
    assert len(stream.info.notes) == 2
    assert stream.info.notes[0].startswith(f"{path} has 3 lines, the last scan is number 3")
    assert "restore" in stream.info.notes[0]
    assert stream.info.notes[1].startswith(f"1 frames have no time in {path} (the first is 3)")
    np.testing.assert_allclose([f.stamp_s for f in stream], [0, 0.1, 0.2, 0.3], atol=1e-9)
    np.testing.assert_allclose([f.turn_s for f in stream], [0.1, 0.1, 0.1, 0.1 if end == "" else 0], atol=1e-9)
    path.write_text("".join([*lines, lines[3]]))
    stream = open_stream(drive)
    (note,) = stream.info.notes
    assert note.startswith(f"{path} has 5 lines, the last scan is number 3")
    np.testing.assert_allclose([f.turn_s for f in stream], 0.1, atol=1e-9)


@pytest.mark.parametrize(
    ("build", "file", "row", "named"),
    [
        (layouts.odometry, "sequences/07/calib.txt", "Tr", "get Tr from data_odometry_calib.zip"),
        (layouts.odometry, "sequences/07/calib.txt", "Tr", "poses.txt needs the Tr of"),
        (layouts.odometry, "sequences/07/calib.txt", "P2", "no P2: no camera"),
        (layouts.tracking, "training/calib/0003.txt", "Tr_velo_cam", "no camera"),
        (layouts.tracking, "training/calib/0003.txt", "R_rect", None),
        (layouts.tracking, "training/calib/0003.txt", "Tr_imu_velo", "no odometry"),
        (layouts.raw_drive, "2011_09_26/calib_cam_to_cam.txt", "P_rect_02", "no camera"),
        (layouts.raw_drive, "2011_09_26/calib_velo_to_cam.txt", "T", "no camera"),
        (layouts.raw_drive, "2011_09_26/calib_imu_to_velo.txt", "R", "no odometry"),
    ],
)
def test_a_missing_row_is_noted_and_the_stream_works(tmp_path, build, file, row, named):
    path, calib = build(tmp_path), tmp_path / file
    lines = calib.read_text().splitlines(keepends=True)
    calib.write_text("".join(line for line in lines if line.replace(":", " ").split()[0] != row))
    stream = open_stream(path)
    notes = " ".join((*stream.info.notes, *stream.info.pose_notes))
    assert notes == "" if named is None else named in notes and calib.name in notes
    assert len(list(stream)) >= 3


def test_missing_frames_leave_gaps_and_a_note(tmp_path):
    stream = open_stream(layouts.raw_drive(tmp_path, [0, 1, 4]))
    assert [f.index for f in stream] == [0, 1, 4]
    assert any("2 frames are missing" in note for note in stream.info.notes)
    assert [round(f.stamp_s, 6) for f in stream] == [0, 0.1, 0.4]


@pytest.mark.parametrize(
    ("lost", "named"),
    [
        ("calib_cam_to_cam.txt", "no camera"),
        ("calib_velo_to_cam.txt", "no camera"),
        ("calib_imu_to_velo.txt", "no odometry"),
        ("2011_09_26_drive_9999_sync/oxts", "no odometry"),
        ("2011_09_26_drive_9999_sync/velodyne_points/timestamps.txt", "0.1 s apart"),
        ("2011_09_26_drive_9999_sync/velodyne_points/timestamps_start.txt", "not deskewed"),
        ("2011_09_26_drive_9999_sync/velodyne_points/timestamps_end.txt", "not deskewed"),
    ],
)
def test_a_missing_file_is_noted_and_the_stream_works(tmp_path, lost, named):
    drive = layouts.raw_drive(tmp_path)
    gone = drive.parent / lost
    shutil.rmtree(gone) if gone.is_dir() else gone.unlink()
    stream = open_stream(drive)
    notes = (*stream.info.notes, *stream.info.pose_notes)
    assert any(named in note and gone.name in note for note in notes), notes
    assert len(list(stream)) == 4


def test_broken_calibration_is_an_error_with_its_file(tmp_path):
    drive = layouts.raw_drive(tmp_path)
    (drive.parent / "calib_velo_to_cam.txt").write_text("R: 1 2 3\n")
    with pytest.raises(MisuseError, match=r"calib_velo_to_cam.*R holds 3 numbers"):
        open_stream(drive)


def test_broken_oxts_is_an_error_with_its_file(tmp_path):
    drive = layouts.raw_drive(tmp_path)
    (drive / "oxts" / "data" / f"{2:010d}.txt").write_text("49.0 8.4 nonsense")
    with pytest.raises(MisuseError, match=r"0000000002\.txt"):
        open_stream(drive)


def test_a_frame_without_a_pose_has_that_of_the_frame_before(tmp_path):
    drive = layouts.raw_drive(tmp_path)
    (drive / "oxts" / "data" / f"{2:010d}.txt").unlink()
    frames = list(open_stream(drive))
    np.testing.assert_array_equal(frames[2].T_world_sensor, frames[1].T_world_sensor)
    assert not np.allclose(frames[3].T_world_sensor, frames[2].T_world_sensor)


def test_bad_scans_are_counted_and_skipped(tmp_path, caplog):
    drive = layouts.raw_drive(tmp_path)
    data = drive / "velodyne_points" / "data"
    (data / f"{1:010d}.bin").write_bytes(b"short")
    broken = layouts.scan(2)
    broken[0, 0] = np.nan
    (data / f"{2:010d}.bin").write_bytes(broken.tobytes())
    stream = open_stream(drive)
    assert [f.index for f in stream] == [0, 2, 3]
    assert [(f.frame, f.skipped) for f in stream.faults.first] == [(1, True), (2, False)]
    assert "truncated" in caplog.text
    assert "not finite" in caplog.text


def test_points_without_reflectance_are_kept_and_counted(tmp_path, caplog):
    folder = layouts.bare(tmp_path)
    broken = layouts.scan(1)
    broken[:3, 3] = np.nan
    (folder / "000001.bin").write_bytes(broken.tobytes())
    stream = open_stream(folder)
    points = [f.points for f in stream][1]
    np.testing.assert_array_equal(points[:, :3], broken[:, :3])
    np.testing.assert_array_equal(points[3:], broken[3:])
    assert (stream.faults.count, stream.faults.skipped) == (1, 0)
    (record,) = caplog.records
    assert re.search(r"000001\.bin: 3 reflectances .* not recorded: .*driver", record.getMessage())


def test_all_faults_are_counted_and_the_first_are_kept(tmp_path, caplog):
    folder, n = layouts.bare(tmp_path), 3 * MAX_KEPT_FAULTS
    for k in range(n):
        (folder / f"{k:06d}.bin").write_bytes(layouts.scan(k).tobytes() + b"cut" * (k % 3 > 0))
    stream = open_stream(folder)
    assert len(list(stream)) == MAX_KEPT_FAULTS
    assert (stream.faults.count, stream.faults.skipped, len(stream.faults.first)) == (
        2 * MAX_KEPT_FAULTS,
        2 * MAX_KEPT_FAULTS,
        MAX_KEPT_FAULTS,
    )
    assert [f.frame for f in stream.faults.first[:3]] == [1, 2, 4]
    assert len(caplog.records) == MAX_KEPT_FAULTS
    assert [("only counted" in r.getMessage()) for r in caplog.records] == [False] * (MAX_KEPT_FAULTS - 1) + [True]


def test_a_stream_without_a_usable_scan_is_an_error(tmp_path):
    folder = layouts.bare(tmp_path)
    for path in folder.glob("*.bin"):
        path.write_bytes(b"")
    with pytest.raises(ModtError, match="none of its 3 scans"):
        list(open_stream(folder))


def test_between_reads_only_its_part(tmp_path):
    stream = open_stream(layouts.raw_drive(tmp_path)).between(1, 3)
    assert stream.info.n_frames == 2
    assert [f.index for f in stream] == [1, 2]


@pytest.mark.parametrize(
    ("make", "cause"),
    [
        (lambda root: root / "nowhere", "no such file"),
        (lambda root: root, "no stream"),
        (lambda root: (root / "a.bin").write_bytes(b"") or root / "a.bin", "no stream"),
        (lambda root: (root / "a.bag").write_bytes(b"#ROSBAG V2.0\n") and root / "a.bag", "ROS 1; convert it"),
        (lambda root: layouts.raw_drive(root).parent.parent, "several streams.*drive_9999"),
    ],
    ids=["missing", "empty", "a file", "ROS 1", "a root"],
)
def test_a_path_without_a_stream_is_refused(tmp_path, make, cause):
    with pytest.raises(MisuseError, match=cause):
        open_stream(make(tmp_path))


def test_a_raw_drive_without_scans_is_refused(tmp_path):
    drive = layouts.raw_drive(tmp_path)
    shutil.rmtree(drive / "velodyne_points")
    with pytest.raises(MisuseError, match="velodyne_points"):
        open_stream(drive)


@pytest.mark.parametrize(
    ("name", "cause"),
    [
        ("a.bag", r"is a recording of ROS 1; convert it: .*rosbags-convert"),
        ("a.LAS", r"is a LAS file; convert it: pdal translate"),
        ("a.laz", r"is a LAS file; convert it: pdal translate"),
        ("a.npy", r"is an array of NumPy; convert it: numpy.load"),
        ("a.xyz", r"is a table of text; convert it: numpy.loadtxt"),
        ("a.osf", r"is a recording of Ouster's SDK; convert it: ouster-cli"),
        ("a.lvx2", r"is a recording of Livox Viewer; record the packets instead: tcpdump"),
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


def test_the_conversion_of_an_array_is_one_that_is_read(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.save("a.npy", np.arange(50.0).reshape(10, 5))
    with pytest.raises(MisuseError) as refused:
        open_stream(tmp_path / "a.npy")
    (tmp_path / "scans").mkdir()
    code = refused.value.remedy.removeprefix("convert it: ").split(", columns")[0].replace("FILE", "'a.npy'")
    exec(code, {"numpy": np})
    (frame,) = open_stream(tmp_path / "scans")
    assert frame.points[1, :3].tolist() == [5.0, 6.0, 7.0]


@pytest.mark.kitti
def test_a_real_drive(drive_0005):
    stream = open_stream(drive_0005)
    assert stream.info.n_frames == 154
    assert stream.info.notes == stream.info.pose_notes == ()
    assert all(0.102 < s.turn_s < 0.105 for s in stream.scans)
    last = stream.scans[-1].T_world_sensor
    # The drive covers 69 m of street; its end is where the inertial unit says.
    assert 60 < np.linalg.norm(last[:3, 3] - stream.scans[0].T_world_sensor[:3, 3]) < 70
    first = next(iter(stream))
    assert len(first.points) > 100_000
