"""Labels of nuScenes and Argoverse 2, and names of labels."""

import json

import numpy as np
import pytest

from modt.classes import ObjectClass
from modt.errors import MisuseError
from modt.geometry import transform_boxes
from modt_evaluation.label_names import CUBOID_TYPES
from modt_evaluation.truth import Role
from modt_evaluation.truth_files import labels_beside, open_truth
from tests.cli.commands import here
from tests.sources import layouts
from tests.sources.datasets import MOUNT_M, Box, Sweep, write_argoverse, write_nuscenes

VEHICLE = (10.0, 2.0, np.pi / 2)


def of_types(*types, **more):
    return tuple(Box(f"i{k}", name, (10.0, 12.0 + k, 0.75), **more) for k, name in enumerate(types))


def scene(root, *frames):
    points = np.ones((50, 4), np.float32)
    return write_nuscenes(
        root, {"scene-0103": [Sweep(100_000 * k, points, VEHICLE, b) for k, b in enumerate(frames)]}
    )


def in_sensor(frame):
    from modt.geometry import inverse

    return transform_boxes(inverse(frame.T_box_sensor), frame.box)


def test_labels_of_key_frames_of_a_scene(tmp_path):
    boxes = of_types("vehicle.car", "human.pedestrian.child", "vehicle.bus.rigid", "movable_object.barrier", yaw=0.5)
    ridden = Box("i7", "vehicle.bicycle", (0, 0, 0), attributes=("cycle.with_rider",))
    parked = Box("i8", "vehicle.bicycle", (1, 0, 0), attributes=("cycle.without_rider",))
    root = scene(tmp_path, boxes, None, (boxes[0], ridden, parked))
    truth = open_truth(root)
    assert (list(truth.frames), truth.key_frames, len(truth.scans.scans)) == ([0, 2], True, 3)
    first = truth.frames[0]
    kinds = [ObjectClass.CAR, ObjectClass.PEDESTRIAN, ObjectClass.CAR, ObjectClass.BACKGROUND]
    assert first.object_class.tolist() == kinds
    assert first.role.tolist() == [Role.COUNTED, Role.COUNTED, Role.NEUTRAL, Role.COUNTED]
    assert in_sensor(first)[0] == pytest.approx(
        [10.0 - MOUNT_M[0], 0.0, 0.75 - MOUNT_M[2], 4.0, 2.0, 1.5, 0.5 - np.pi / 2], abs=1e-6
    )
    last = truth.frames[2]
    assert last.object_class.tolist() == [ObjectClass.CAR, ObjectClass.CYCLIST, ObjectClass.BACKGROUND]
    assert last.id[0] == first.id[0]
    assert last.type_[2] == "vehicle.bicycle.without_rider"
    assert labels_beside(root / "scene-0103") == root / "scene-0103"
    assert labels_beside(tmp_path.parent) is None


@pytest.mark.parametrize("table", ["sample_annotation", "category", "instance", "attribute"])
def test_broken_annotations_are_named(tmp_path, table):
    root = scene(tmp_path, of_types("vehicle.car", attributes=("vehicle.moving",)))
    path = root / "v1.0-mini" / f"{table}.json"
    path.write_text("[]" if table != "sample_annotation" else path.read_text().replace("[2.0, 4.0", '["a", 4.0'))
    with pytest.raises(MisuseError, match=r"sample_annotation\.json: no box"):
        open_truth(root)
    path.write_text('[{"token": 3}]')
    with pytest.raises(MisuseError, match=rf"{table}\.json"):
        open_truth(root)


def test_labels_of_a_log(tmp_path):
    pytest.importorskip("pyarrow", reason="needs the extra [parquet]")
    points = np.ones((50, 4), np.float32)
    boxes = of_types("REGULAR_VEHICLE", "BICYCLIST", "BUS", "BOLLARD", yaw=0.5)
    log = write_argoverse(tmp_path / "log", [Sweep(100_000 * k, points, VEHICLE, boxes[k:]) for k in range(2)])
    truth = open_truth(log)
    first = truth.frames[0]
    assert first.object_class.tolist() == [ObjectClass.CAR, ObjectClass.CYCLIST, ObjectClass.CAR, 0]
    assert in_sensor(first)[0] == pytest.approx([10.0 - 1.35, 12.0, 0.75 - 1.64, 4.0, 2.0, 1.5, 0.5])
    assert truth.frames[1].id.tolist() == first.id.tolist()[1:]
    assert not truth.key_frames
    assert labels_beside(log) == log
    (log / "annotations.feather").write_bytes(b"x")
    with pytest.raises(MisuseError, match=r"annotations\.feather: cannot be read"):
        open_truth(log)


def cuboids(folder, name, frames=(0, 1), scans=(0, 1)):
    layouts.write_scans(folder / "scans", scans)
    rows = "".join(f"{frame},3,{name},9,1,0.5,4,2,1.5,0.1\n" for frame in frames)
    (folder / "truth.csv").write_text("frame,track,label,x,y,z,l,w,h,yaw\n" + rows)
    (folder / "poses.txt").write_text("".join(f"1 0 0 {k} 0 1 0 0 0 0 1 0\n" for k in range(len(scans))))
    return folder


def test_an_unknown_name_is_an_error_with_those_that_are_known(tmp_path):
    names = r"human\.pedestrian\.adult.*vehicle\.car,"
    with pytest.raises(MisuseError, match=rf"'vehicle\.cart' is unknown; did you mean 'vehicle\.car'\? .*{names}"):
        open_truth(cuboids(tmp_path, "vehicle.cart"))
    drive = layouts.raw_drive(tmp_path / "kitti")
    item = "<item><objectType>Boat</objectType><h>1</h><w>1</w><l>1</l><first_frame>0</first_frame><poses><item>"
    item += "<tx>1</tx><ty>1</ty><tz>1</tz><rx>0</rx><ry>0</ry><rz>0</rz></item></poses></item>"
    (drive / "tracklet_labels.xml").write_text(f"<root><tracklets>{item}</tracklets></root>")
    with pytest.raises(MisuseError, match="label 'Boat' is unknown"):
        open_truth(drive)


@pytest.mark.parametrize("name", ["vehicle.car", "REGULAR_VEHICLE", "Pickup_Truck", "car", "Car", "TYPE_VEHICLE"])
def test_a_table_of_cuboids_takes_the_names_of_any_data_set(tmp_path, name):
    assert open_truth(cuboids(tmp_path, name)).frames[0].object_class.tolist() == [ObjectClass.CAR]
    assert CUBOID_TYPES[name] == (ObjectClass.CAR, Role.COUNTED)


@pytest.mark.parametrize("frames", [(40, 42), (0, 1)])
def test_scans_whose_numbers_do_not_begin_at_0(tmp_path, frames):
    truth = open_truth(cuboids(tmp_path, "Car", frames, scans=(40, 42)))
    assert list(truth.frames) == [40, 42]
    assert [len(frame.id) for frame in truth.frames.values()] == [1, 1]
    assert truth.frames[42].T_box_sensor[0, 3] == 1.0
    if frames == (40, 42):
        (tmp_path / "truth.csv").write_text("frame,track,label,x,y,z,l,w,h,yaw\n41,3,Car,9,1,0.5,4,2,1.5,0.1\n")
        with pytest.raises(MisuseError, match=r"none for frame 41; .* counts from 0"):
            open_truth(tmp_path)


@pytest.mark.command
def test_a_scene_is_replayed_and_judged_by_its_key_frames(tmp_path, capsys):
    from modt_simulation.synthetic_stream import SyntheticStream

    sweeps = []
    for k, frame in enumerate(SyntheticStream("street", "hdl-32e", 0.5, 1)):
        boxes = of_types("vehicle.car") if not k % 2 else None
        points = frame.points[frame.points[:, :3].any(axis=1)].copy()
        sweeps.append(Sweep(100_000 * k, points, (0.0, 0.0, 0.0), boxes))
    write_nuscenes(tmp_path / "data", {"scene-0001": sweeps, "scene-0002": sweeps[:3]})
    path = tmp_path / "data" / "scene-0001"
    assert here("replay", path, "--labels", "--quiet", "--out", tmp_path / "run") == 0
    capsys.readouterr()
    assert here("evaluate", tmp_path / "run", path, "--json") == 0
    (scores,) = json.loads(capsys.readouterr().out)["sensors"].values()
    assert scores["frames"] == 3
    assert here("check", path, "--core", "none", "--out", tmp_path / "out") in (0, 1)
    assert "no such file" not in capsys.readouterr().out
