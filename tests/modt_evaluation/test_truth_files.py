import numpy as np
import pytest

from modt.classes import ObjectClass
from modt.errors import MisuseError
from modt.geometry import rotation_zyx, transform
from modt.types import NONE
from modt_evaluation.rules import CUBOID_RULES, KITTI_ALL_ROUND_RULES, KITTI_RULES
from modt_evaluation.truth import Role
from modt_evaluation.truth_files import open_truth
from tests.sources import layouts

ITEM = """<item><objectType>{type}</objectType><h>1.5</h><w>2</w><l>4</l><first_frame>{first}</first_frame>
<poses>{poses}</poses></item>"""
POSE = "<item><tx>10</tx><ty>{y}</ty><tz>-1.7</tz><rx>0</rx><ry>0</ry><rz>0.5</rz></item>"
LABEL = "{type} 0 0 -1.5 {edges} 1.5 2.0 4.0 1.0 1.7 10.0 -1.5708\n"
CUBOID = "frame,track,label,x,y,z,l,w,h,yaw\n"


def tracklets(drive, *items):
    text = "".join(
        ITEM.format(type=type_, first=first, poses="".join(POSE.format(y=y) for y in places))
        for type_, first, places in items
    )
    (drive / "tracklet_labels.xml").write_text(f"<root><tracklets>{text}</tracklets></root>")
    return drive


def test_raw_drive(tmp_path):
    drive = tracklets(layouts.raw_drive(tmp_path), ("Car", 1, [8, 9]), ("Tram", 0, [30]), ("Van", 3, [5]))
    truth = open_truth(drive)
    assert (list(truth.frames), truth.rules, len(truth.scans.scans)) == ([0, 1, 2, 3], KITTI_RULES, 4)
    first = truth.frames[0]
    second = truth.frames[1]
    assert (first.type_, first.object_class.tolist(), first.id.tolist()) == (("Tram",), [0], [1])
    assert second.box[0] == pytest.approx([10, 8, -0.95, 4, 2, 1.5, 0.5])
    assert truth.frames[3].role.tolist() == [Role.COUNTED]
    assert open_truth(drive, paper=True).frames[3].role.tolist() == [Role.IGNORED]


def test_a_tracklet_leans_as_its_turns_about_x_and_y_say(tmp_path):
    drive = tracklets(layouts.raw_drive(tmp_path), ("Car", 0, [8]), ("Car", 1, [9]))
    path = drive / "tracklet_labels.xml"
    path.write_text(path.read_text().replace("<rx>0</rx><ry>0</ry>", "<rx>0.1</rx><ry>-0.2</ry>", 1))
    leaning, upright = (open_truth(drive).frames[k] for k in (0, 1))
    R_sensor_box = rotation_zyx(0.1, -0.2, 0.5)
    foot = transform(leaning.T_box_sensor, np.array([[10, 8, -1.7]]))
    (box,) = leaning.box
    assert box[:3] - [0, 0, 0.75] == pytest.approx(foot[0])
    np.testing.assert_allclose(leaning.T_box_sensor[:3, :3] @ R_sensor_box, rotation_zyx(0, 0, box[6]), atol=1e-12)
    np.testing.assert_array_equal(upright.T_box_sensor, np.eye(4))


@pytest.mark.parametrize(("x", "rules"), [(-1, KITTI_RULES), (-9, KITTI_ALL_ROUND_RULES)])
def test_the_sector_follows_tracklets_behind_the_sensor(tmp_path, x, rules):
    drive = tracklets(layouts.raw_drive(tmp_path), ("Car", 0, [8]), ("Car", 0, [3]))
    path = drive / "tracklet_labels.xml"
    path.write_text(path.read_text().replace("<tx>10<", f"<tx>{x}<", 1))
    assert open_truth(drive).rules == rules
    assert (rules.sector_deg, rules.complete) == ((180, True) if x == -9 else (40, False))


def test_parked_cars_before_and_after_their_tracklets(tmp_path):
    places = [20 - frame for frame in range(6)]  # the sensor goes a metre a frame to its left
    items = ("Car", 1, places[1:4]), ("Car", 1, [20, 20, 20]), ("Pedestrian", 1, places[1:4]), ("Car", 1, [19, 18])
    truth = open_truth(tracklets(layouts.raw_drive(tmp_path, range(6)), *items))
    assert [len(truth.frames[f].parked) for f in range(6)] == [1, 0, 0, 0, 1, 1]
    assert truth.frames[5].parked[0] == pytest.approx([10, 15, -0.95, 4, 2, 1.5, 0.5], abs=0.01)


def test_tracking_labels(tmp_path):
    scans = layouts.tracking(tmp_path)
    folder = scans.parents[1] / "label_02"
    folder.mkdir()
    car = LABEL.format(type="Car", edges="0 0 9 9")
    nothing = LABEL.format(type="DontCare", edges="5 6 7 8")
    (folder / "0003.txt").write_text(f"0 4 {car}0 -1 {nothing}2 4 {car}")
    for path in (folder / "0003.txt", scans.parents[1]):
        truth = open_truth(path, run_path=scans)
        assert [frame.id.tolist() for frame in truth.frames.values()] == [[4], [], [4]]
        assert truth.frames[0].box[0] == pytest.approx([10, -1, -0.95, 4, 2, 1.5, 0], abs=1e-4)
        assert truth.frames[0].regions.edges.tolist() == [[5, 6, 7, 8]]
        assert truth.frames[2].regions is None
    with pytest.raises(MisuseError, match=r"label_02/NNNN\.txt"):
        open_truth(scans.parents[1])


def test_object_labels_have_no_identities(tmp_path):
    layouts.write_scans(tmp_path / "velodyne", [7])
    (tmp_path / "label_2").mkdir()
    (tmp_path / "calib").mkdir()
    (tmp_path / "label_2" / "000007.txt").write_text(LABEL.format(type="Person_sitting", edges="0 0 9 9"))
    camera = layouts.CAMERA
    (tmp_path / "calib" / "000007.txt").write_text(
        f"P2: {camera['P']}\nR0_rect: {camera['R']}\nTr_velo_to_cam: {camera['Tr']}\n"
    )
    truth = open_truth(tmp_path)
    assert truth.frames[7].id.tolist() == [NONE]
    assert truth.frames[7].object_class.tolist() == [ObjectClass.PEDESTRIAN]


def cuboids(folder, text):
    folder.joinpath("truth.csv").write_text(CUBOID + text)
    folder.joinpath("poses.txt").write_text("1 0 0 5 0 1 0 0 0 0 1 0\n" * 2)
    return folder


def test_cuboids(tmp_path):
    layouts.write_scans(tmp_path / "scans", range(2))
    truth = open_truth(cuboids(tmp_path, "0,3,Motorcycle,9,1,0.5,2,1,1.5,0.1\n0,4,Bus,9,5,0.5,9,2,3,0\n"))
    first = truth.frames[0]
    assert (truth.rules, first.object_class.tolist()) == (CUBOID_RULES, [ObjectClass.CYCLIST, ObjectClass.CAR])
    assert first.role.tolist() == [Role.COUNTED, Role.NEUTRAL]
    assert first.T_box_sensor[0, 3] == 5
    assert len(truth.frames[1].id) == 0


def test_a_table_beside_each_scan(tmp_path):
    layouts.write_scans(tmp_path / "scans", [40, 70])
    (tmp_path / "000070.csv").write_text(
        "class,x,y,z,length,width,height,yaw,points\nTYPE_VEHICLE,9,1,0,4,2,1.5,0,3\n"
    )
    truth = open_truth(tmp_path)
    assert list(truth.frames) == [70]
    assert truth.frames[70].box.tolist() == [[9, 1, 0, 4, 2, 1.5, 0]]


def labels(folder, text):
    path = layouts.tracking(folder).parents[1] / "label_02" / "0003.txt"
    path.parent.mkdir()
    path.write_text("0 4 " + LABEL.format(type="Car", edges="0 0 9 9") + text)
    return path


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda p: p / "nowhere", "no such file"),
        (lambda p: p, "holds no labels that are recognised"),
        (lambda p: cuboids(p, "0,3,Car,9,x,0.5,2,1,1.5,0.1\n"), r"truth\.csv:2: no cuboid"),
        (lambda p: cuboids(p, "0,b,Car,9,1,0.5,2,1,1.5,0.1\n"), r"truth\.csv:2: no cuboid"),
        (lambda p: cuboids(p, "2,3,Car,9,1,0.5,2,1,1.5,0.1\n"), r"2 poses, none for frame 2"),
        (lambda p: tracklets(layouts.raw_drive(p), ("Car", "x", [1])), "item 0 is no tracklet"),
        (lambda p: labels(p, "0 4 Car 0 0\n"), r"0003\.txt:2: no label"),
        (lambda p: labels(p, "0 4 " + LABEL.format(type="Car", edges="a b c d")), r"0003\.txt:2: no label"),
    ],
)
def test_broken_truth(tmp_path, make, message):
    with pytest.raises(MisuseError, match=message):
        open_truth(make(tmp_path))


@pytest.mark.kitti
def test_real_labels(kitti_root):
    assert len(open_truth(kitti_root / "object" / "training").frames) > 100
    assert len(open_truth(kitti_root / "pandaset").frames) == 9
    assert len(open_truth(kitti_root / "pandaset_002").frames) == 40
