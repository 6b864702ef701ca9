"""Scenes of nuScenes and logs of Argoverse 2, by name, with poses, axes and times."""

import json
import sys

import numpy as np
import pytest

from modt.errors import MisuseError
from modt.sources import nuscenes
from modt.sources.recognise import open_scans, open_stream
from tests.sources import layouts
from tests.sources.datasets import BEGAN_US, MOUNT_M, Sweep, write_argoverse, write_nuscenes


def points(seed=0):
    table = np.random.default_rng(seed).uniform(-20, 20, (60, 4)).astype(np.float32)
    table[:, 3] = np.random.default_rng(seed).integers(0, 255, 60)
    return table


def sweeps(n=5, period_us=50_000, keys=1, **more):
    """Sweeps of a vehicle that goes a metre a sweep to the left of the world and looks that way."""
    return [
        Sweep(k * period_us, points(k), (10.0, 1.0 * k, np.pi / 2), () if not k % keys else None, **more)
        for k in range(n)
    ]


def test_a_scene_has_sweeps_between_key_frames_times_poses_and_the_axes_of_modt(tmp_path):
    root = write_nuscenes(tmp_path / "nuscenes", {"scene-0001": sweeps(keys=2)})
    stream = open_stream(root)
    info = stream.info
    assert (info.name, info.layout, info.period_s, info.profile) == ("scene-0001", "nuScenes scene", 0.05, "hdl-32e")
    frames = list(stream)
    assert [frame.stamp_s for frame in frames] == pytest.approx([0.05 * k for k in range(5)], abs=1e-9)
    assert frames[1].points[:, :3] == pytest.approx(points(1)[:, :3])
    assert frames[1].points[:, 3] == pytest.approx(points(1)[:, 3] / 255)
    ahead = frames[2].T_world_sensor @ [5.0, 0.0, 0.0, 1.0]
    assert ahead == pytest.approx([10.0, 2.0 + MOUNT_M[0] + 5.0, MOUNT_M[2], 1.0], abs=1e-6)


def test_one_of_several_scenes_and_versions_is_chosen_by_name(tmp_path):
    root = write_nuscenes(tmp_path, {"scene-0001": sweeps(2), "scene-0002": sweeps(3)})
    assert len(open_scans(root / "scene-0002").scans) == 3
    assert len(open_scans(root / "v1.0-mini" / "scene-0001").scans) == 2
    with pytest.raises(MisuseError, match=r"holds 2 scenes; append one: .*SCENE of scene-0001, scene-0002"):
        open_scans(root)
    with pytest.raises(MisuseError, match="no scene scene-0003"):
        open_scans(root / "scene-0003")
    assert open_scans(root / "samples" / "LIDAR_TOP").info.layout == "folder of scans"
    write_nuscenes(root, {}, "v1.0-test")
    with pytest.raises(MisuseError, match="several versions"):
        open_scans(root / "scene-0001")


def test_files_of_nuscenes_alone_are_stamped_by_their_microseconds(tmp_path):
    root = write_nuscenes(tmp_path, {"scene-0001": sweeps(4)})
    stream = open_scans(root / "samples" / "LIDAR_TOP")
    assert [scan.stamp_s for scan in stream.scans] == pytest.approx([0.0, 0.05, 0.1, 0.15], abs=1e-6)
    assert str(BEGAN_US) in stream.scans[0].path.name


def test_sweeps_that_are_not_unpacked_are_noted(tmp_path):
    root = write_nuscenes(tmp_path, {"scene-0001": sweeps(keys=2)})
    for file in (root / "sweeps" / "LIDAR_TOP").iterdir():
        file.unlink()
    stream = open_scans(root)
    assert (len(stream.scans), stream.info.period_s) == (3, 0.1)
    assert stream.info.notes == (f"2 sweeps of scene-0001 are not in {root.resolve()}",)
    for file in (root / "samples" / "LIDAR_TOP").iterdir():
        file.unlink()
    (root / "v1.0-mini" / "scene.json").touch()
    nuscenes.read_scene.cache_clear()
    with pytest.raises(MisuseError, match=r"no sweeps of scene-0001; unpack"):
        open_scans(root)


@pytest.mark.parametrize("table", ["scene", "sample", "sample_data", "ego_pose", "calibrated_sensor", "sensor"])
@pytest.mark.parametrize("text", ["", "[1]", "{", '{"a": 1}', "null", '[{"token": "x"}]', "[" * 100_000])
def test_a_broken_table_is_named(tmp_path, table, text):
    root = write_nuscenes(tmp_path, {"scene-0001": sweeps(2)})
    path = root / "v1.0-mini" / f"{table}.json"
    path.write_text(text)
    with pytest.raises(MisuseError, match=rf"{table}\.json"):
        open_scans(root)


@pytest.mark.parametrize("value", [None, [0, 0, 0, 0], [1, 2], ["a", 0, 0, 0], [float("nan"), 0, 0, 0]])
def test_a_broken_pose_is_named(tmp_path, value):
    root = write_nuscenes(tmp_path, {"scene-0001": sweeps(2)})
    path = root / "v1.0-mini" / "ego_pose.json"
    rows = json.loads(path.read_text())
    rows[1]["rotation"] = value
    path.write_text(json.dumps(rows))
    with pytest.raises(MisuseError, match="tables do not fit together"):
        open_scans(root)


@pytest.fixture
def log(tmp_path):
    pytest.importorskip("pyarrow", reason="needs the extra [parquet]")
    return write_argoverse(tmp_path / "0b86f508-5df9-4a46-bc59-5b9536dbde9f", sweeps(4, period_us=100_000))


def test_a_log_has_times_poses_and_points_from_its_sensor(log):
    for path in (log, log / "sensors", log / "sensors" / "lidar"):
        stream = open_stream(path)
        assert (stream.info.name, stream.info.layout, stream.info.period_s) == (log.name, "Argoverse 2 log", 0.1)
    frames = list(stream)
    assert [frame.stamp_s for frame in frames] == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert frames[1].points[:, :3] == pytest.approx(points(1)[:, :3], abs=0.02)  # 16 bits
    assert frames[1].points[:, 3] == pytest.approx(points(1)[:, 3] / 255)
    assert frames[2].T_world_sensor @ [5.0, 0.0, 0.0, 1.0] == pytest.approx([10.0, 2.0 + 1.35 + 5.0, 1.64, 1.0])


def test_a_log_without_poses_or_with_a_broken_sweep_goes_on(log):
    (log / "city_SE3_egovehicle.feather").unlink()
    (log / "calibration" / "egovehicle_SE3_sensor.feather").unlink()
    first = min((log / "sensors" / "lidar").iterdir())
    first.write_bytes(first.read_bytes()[:100])
    stream = open_scans(log)
    assert [frame.index for frame in stream] == [1, 2, 3]
    assert not stream.info.has_poses
    assert len(stream.info.notes) == 2
    assert stream.faults.skipped == 1


def test_pyarrow_is_asked_for(tmp_path, monkeypatch):
    folder = tmp_path / "log" / "sensors" / "lidar"
    folder.mkdir(parents=True)
    (folder / "315966265259836000.feather").write_bytes(b"x")
    (tmp_path / "log" / "city_SE3_egovehicle.feather").write_bytes(b"x")
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(MisuseError, match=r"needs pyarrow.*parquet"):
        open_scans(tmp_path / "log")


def test_a_folder_of_cuboids_is_replayed_where_its_page_points(tmp_path):
    layouts.write_scans(tmp_path / "scans", range(2))
    (tmp_path / "truth.csv").write_text("frame\n")
    assert len(open_scans(tmp_path).scans) == 2
