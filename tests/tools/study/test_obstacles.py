"""The study of obstacles, against a perfect, a blind and a lumping segmentation."""

from dataclasses import replace

import numpy as np
import pytest

from modt.classes import ObjectClass
from modt.types import NONE, Cut, PointKind, Proposals, Tracks
from modt_simulation.builder import SceneBuilder
from modt_simulation.materials import Material
from modt_simulation.motion import Path
from modt_simulation.solids import block
from modt_simulation.synthetic_stream import SCENES, SyntheticStream
from modt_simulation.yard import floor
from tests.results import result
from tools.study.mounts import of_mount
from tools.study.obstacles import UNCOUNTED, Drive, ratio, row_of_place, rows_of_roles, run


def judged(group_of_body, reported=ObjectClass.PEDESTRIAN, cut=0):
    """Rows of roles and row of the place of one frame, by the proposal of each body; all tracks have one class."""
    stream = SyntheticStream("wall", "os1-64", 0.1, 1, height_m=0.8)
    world = stream.simulator.world
    frame, truth = stream.simulator.sweep(0)
    group = np.append(group_of_body(world), NONE)[truth.instance]
    members = np.argsort(group, kind="stable")[np.count_nonzero(group == NONE) :]
    used, count = np.unique(group[members], return_counts=True)
    n = len(used)
    blank = np.zeros((n, 3))
    proposals = replace(
        Proposals.empty(np.where(group == NONE, PointKind.GROUND, PointKind.MEMBER).astype(np.int8)),
        members=members,
        offsets=np.append(0, np.cumsum(count)),
        coordinates=np.zeros((3, len(members)), np.float32),
        centroid=blank,
        box=np.zeros((n, 7)),
        cut=np.full(n, cut),
    )
    tracks = Tracks.blank(n)
    tracks.id[:] = np.arange(n) + 5
    tracks.proposal[:] = np.arange(n)
    tracks.object_class[:] = reported
    drive = Drive(world, of_mount("os1-64", 0.8))
    drive.add(frame, truth, replace(result(0, [], {}), frame=frame, proposals=proposals, tracks=tracks))
    return {row[0]: row[1:] for row in rows_of_roles([drive])}, row_of_place([drive])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "seed"), [("hidden", 901), ("platform", 902), ("platform", 905), ("overhangs", 941)]
)
def test_people_who_are_hidden_or_raised_are_recalled(scene, seed):
    drive = run(SyntheticStream(scene, "vlp-16", 1.0, seed, height_m=0.8), "accurate")
    seen = sum(role.seen for role in drive.roles.values())
    assert seen >= 10
    assert sum(role.recalled for role in drive.roles.values()) > 0.8 * seen


def annotated(world):
    return np.array([bool(body.kind.name) for body in world.bodies])


def test_a_proposal_for_each_body_detects_every_actor():
    roles, place = judged(lambda world: np.where(annotated(world), np.arange(len(world.bodies)), NONE))
    assert roles["in a queue"][1:] == [*["100 [100, 100]"] * 3, "1 [1, 1]"]
    assert roles["Car"][1:3] == ["100 [100, 100]", "0 [0, 0]"]
    assert place == ["100 [100, 100]", "-", *["0 [0, 0]"] * 4]  # nobody is within 3 m


def test_who_is_said_to_be_a_possible_person_is_possible_and_not_recalled():
    roles, _ = judged(lambda world: np.arange(len(world.bodies)), ObjectClass.BACKGROUND, Cut.TOP)
    assert roles["in a queue"][2:4] == ["0 [0, 0]", "100 [100, 100]"]
    roles, _ = judged(lambda world: np.arange(len(world.bodies)), ObjectClass.BACKGROUND)
    assert roles["in a queue"][2:4] == ["0 [0, 0]", "0 [0, 0]"]


def test_no_proposal_detects_none_and_keeps_nothing():
    roles, place = judged(lambda world: np.full(len(world.bodies), NONE))
    assert roles["in a queue"] == ["1", *["0 [0, 0]"] * 3, "-"]
    assert place[0] == "0 [0, 0]"


def test_one_proposal_for_all_keeps_everything_and_detects_none_and_is_false():
    roles, place = judged(lambda world: np.zeros(len(world.bodies), np.int64))
    assert {row[1] for row in roles.values()} == {"0 [0, 0]"}
    assert place[:3] == ["100 [100, 100]", "-", "0 [0, 0]"]
    assert place[3:] == ["0 [0, 0]", "1 [1, 1]", "0 [0, 0]"]


def test_the_interval_holds_the_ratio_and_shrinks_with_drives():
    rng = np.random.default_rng(1)
    width = []
    for n in (8, 200):
        of = rng.integers(50, 100, n)
        shown = ratio(np.column_stack([rng.binomial(of, 0.3), of]))
        value, low, high = (float(word.strip("[],")) for word in shown.split())
        assert low < value < high
        assert value == pytest.approx(30, abs=6)
        width.append(high - low)
    assert width[1] < 0.5 * width[0]
    assert ratio([(0, 0)]) == "-"


@pytest.mark.slow
def test_a_person_at_three_metres_is_recalled_and_a_bin_is_no_person(monkeypatch):
    def scene(rng, seconds, height_m):
        builder = SceneBuilder(rng, seconds)
        builder.pedestrian(Path.standing(3.0, 0.0, np.pi), role="person")
        builder.scenery(block((0.5, 0.5, 1.1), Material.METAL), 0.0, 3.0)
        return builder.world(floor(rng, (8.0, 8.0), Material.PAVING, 0.006), Path.standing(0, 0, 0), height_m)

    monkeypatch.setitem(SCENES, "person and bin", scene)
    drive = run(SyntheticStream("person and bin", "os1-32", (UNCOUNTED + 2) / 10, 3), "accurate")
    (row,) = rows_of_roles([drive])
    assert row[:4] == ["person", "2", "100 [100, 100]", "100 [100, 100]"]
    assert drive.false.sum() == drive.false[ObjectClass.BACKGROUND] > 0


@pytest.mark.slow
def test_a_drive_has_people_in_the_open_detected_and_recalled():
    drive = run(SyntheticStream("stairs", "vlp-16", 1.0, 3, height_m=0.8), "accurate")
    people = {row[0]: row[1:] for row in rows_of_roles([drive])}["Pedestrian"]
    assert int(people[0]) >= 5
    assert float(people[1].split()[0]) > 60
    assert drive.frames == 10 - UNCOUNTED
