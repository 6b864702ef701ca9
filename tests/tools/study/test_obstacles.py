"""The study of obstacles, against a perfect, a blind and a lumping segmentation."""

from dataclasses import replace

import numpy as np
import pytest

from modt.types import NONE, PointKind, Proposals, Tracks
from modt_simulation.synthetic_stream import SyntheticStream
from tests.results import result
from tools.study.mounts import of_mount
from tools.study.obstacles import Drive, ratio, row_of_place, rows_of_roles, run


def judged(group_of_body):
    """Rows of roles and row of the place of one frame, by the proposal of each body; all tracks are pedestrians."""
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
        cut=np.zeros(n, np.int64),
    )
    tracks = Tracks.blank(n)
    tracks.id[:] = np.arange(n) + 5
    tracks.proposal[:] = np.arange(n)
    tracks.object_class[:] = 2
    drive = Drive(world, of_mount("os1-64", 0.8))
    drive.add(frame, truth, replace(result(0, [], {}), frame=frame, proposals=proposals, tracks=tracks))
    return {row[0]: row[1:] for row in rows_of_roles([drive])}, row_of_place([drive])


def annotated(world):
    return np.array([bool(body.kind.name) for body in world.bodies])


def test_a_proposal_for_each_body_detects_every_actor():
    roles, place = judged(lambda world: np.where(annotated(world), np.arange(len(world.bodies)), NONE))
    assert roles["in a queue"][1:] == ["100 [100, 100]", "100 [100, 100]", "1 [1, 1]"]
    assert roles["Car"][1:3] == ["100 [100, 100]", "0 [0, 0]"]
    assert place == ["100 [100, 100]", "-", *["0 [0, 0]"] * 4]  # nobody is within 3 m


def test_no_proposal_detects_none_and_keeps_nothing():
    roles, place = judged(lambda world: np.full(len(world.bodies), NONE))
    assert roles["in a doorway"] == ["1", "0 [0, 0]", "0 [0, 0]", "-"]
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
def test_a_drive_has_people_in_the_open_detected_and_recalled():
    drive = run(SyntheticStream("stairs", "vlp-16", 1.0, 3, height_m=0.8), "accurate")
    people = {row[0]: row[1:] for row in rows_of_roles([drive])}["Pedestrian"]
    assert int(people[0]) >= 10
    assert float(people[1].split()[0]) > 60
    assert drive.frames == 10
