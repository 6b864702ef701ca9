"""Objects that the labels leave out."""

import numpy as np
import pytest

from modt.classes import ObjectClass
from modt.errors import MisuseError
from modt.types import NONE
from modt_evaluation.further_objects import COLUMNS, with_further
from modt_evaluation.matching import judge
from modt_evaluation.rules import CUBOID_RULES, KITTI_RULES
from modt_evaluation.truth import KITTI_TYPES, PAPER_TYPES, Role, Truth
from tests.modt_evaluation.scenes import blob, cars, frame, score

HEAD = ",".join(COLUMNS) + "\n"
CAR_AT_20 = "0,5,Car,20,0,-1.7,4,2,1.5,0\n"


def further(folder, text, *, truth=None, types=KITTI_TYPES):
    """The truth of a frame, by default a car 10 m ahead, with the objects of a table."""
    path = folder / "further.csv"
    path.write_text(HEAD + text)
    return with_further(Truth({0: truth or cars(10.0)}, None, KITTI_RULES), path, types).frames[0]


def test_a_row_is_a_box_on_its_foot_in_the_sensor_frame(tmp_path):
    found = further(tmp_path, "0,5,Pedestrian,7,-6.5,-1.7,0.8,0.6,2,0.5\n")
    assert (found.type_, found.id.tolist()) == (("Car", "Pedestrian"), [0, 5])
    assert found.object_class.tolist() == [ObjectClass.CAR, ObjectClass.PEDESTRIAN]
    assert found.role.tolist() == [Role.COUNTED, Role.FURTHER]
    assert found.box[1] == pytest.approx([7, -6.5, -0.7, 0.8, 0.6, 2, 0.5])
    moved = np.eye(4)
    moved[:3, 3] = 100, 0, 3
    placed = further(tmp_path, CAR_AT_20, truth=cars(10.0, T_box_sensor=moved))
    assert placed.box[1] == pytest.approx([120, 0, 2.05, 4, 2, 1.5, 0])
    ignored = further(tmp_path, CAR_AT_20.replace("Car", "Van"), types=PAPER_TYPES)
    assert ignored.role.tolist() == [Role.COUNTED, Role.IGNORED]
    parked = further(tmp_path, CAR_AT_20.replace("Car", "IgnoredCar"))
    assert (len(parked.id), len(parked.parked)) == (1, 1)


def test_further_objects_count_for_their_class_alone(tmp_path):
    blobs = [(blob(40, 10), 0), (blob(40, 20), 1)]
    tracks = [(7, 0, "car"), (8, 1, "car")]
    bare, more = (score([frame(truth, blobs, tracks)]) for truth in (cars(10.0), further(tmp_path, CAR_AT_20)))
    before, after = (found.ranges["all"].classification["car"] for found in (bare, more))
    assert (before.objects, before.precision, before.average_precision) == (1, 0.5, 1)
    assert (after.objects, after.precision, after.average_precision, after.objects_called) == (2, 1, 1, 1)
    assert more.ranges["all"].segmentation == bare.ranges["all"].segmentation
    assert after.segmentable == before.segmentable == 1
    assert more.tracks == bare.tracks
    association = judge(frame(further(tmp_path, CAR_AT_20), blobs, tracks), KITTI_RULES).associations[0]
    assert (association.truth.tolist(), association.track.tolist()) == ([0], [7]), "the metrics leave them out"
    assert (more.further_objects, more.further_labels, bare.further_objects) == (1, 1, 0)


@pytest.mark.parametrize(("n", "rules", "counts"), [(7, KITTI_RULES, 0), (8, KITTI_RULES, 1), (19, CUBOID_RULES, 0)])
def test_least_points_of_a_further_object(tmp_path, n, rules, counts):
    scene = frame(further(tmp_path, CAR_AT_20), [(blob(n, 20), 0)], [(7, 0, "pedestrian")])
    objects, proposals = judge(scene, rules)[:2]
    assert objects["to_classify"].tolist() == [False, bool(counts)]
    assert proposals["to_classify"].tolist() == [bool(counts)]  # on an object with too few points, not a false one


def test_an_object_that_is_not_called_what_it_is(tmp_path):
    truth = further(tmp_path, CAR_AT_20 + "0,6,Car,30,0,-1.7,4,2,1.5,0\n")
    scene = frame(
        truth, [(blob(40, 10), 0), (blob(40, 20), 1), (blob(40, 30), NONE)], [(7, 0, "car"), (8, 1, "cyclist")]
    )
    assert judge(scene, KITTI_RULES).objects["reported_by_match"].tolist() == [
        ObjectClass.CAR,
        ObjectClass.CYCLIST,
        NONE,
    ]
    assert score([scene]).ranges["all"].classification["car"].objects_called == pytest.approx(1 / 3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (HEAD + "0,5,Car,20,0,-1.7,4,2,1.5\n", r"further\.csv:2: no object; write frame"),
        (HEAD + CAR_AT_20 + "0,6,Car,x,0,-1.7,4,2,1.5,0\n", r"further\.csv:3: no object"),
        (HEAD + "0,5,Car,nan,0,-1.7,4,2,1.5,0\n", r"further\.csv:2: no object"),
        (HEAD + "0,5,Car,20,0,-1.7,4,0,1.5,0\n", r"further\.csv:2: no object"),
        (HEAD + "0,5,car,20,0,-1.7,4,2,1.5,0\n", r"further\.csv:2: 'car' .* write one of Car"),
        (HEAD + "1,5,Car,20,0,-1.7,4,2,1.5,0\n", r"further\.csv:2: frame 1 is not in the truth"),
        (HEAD + 2 * CAR_AT_20, r"further\.csv:3: object 5 is in frame 0 twice"),
        (HEAD.replace("yaw", "turn") + CAR_AT_20, r"further\.csv:1: has no column yaw; begin with the line frame"),
        (HEAD, r"further\.csv: holds no objects"),
        ("\udcff", r"further\.csv: cannot be read"),
    ],
)
def test_broken_tables(tmp_path, text, message):
    path = tmp_path / "further.csv"
    path.write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(MisuseError, match=message) as error:
        with_further(Truth({0: cars(10.0)}, None, KITTI_RULES), path, KITTI_TYPES)
    assert "\n" not in str(error.value)
