"""The tools that judge tracking, and what they find on small scenes."""

import sys

import numpy as np
import pytest
from modt.tracking.background_map import NoBackgroundMap

from modt.geometry import rotation_zyx, se3
from modt.sinks.kitti_raw import DriveWriter
from modt.sources.recognise import open_stream
from modt.sources.synthetic_stream import SyntheticStream
from modt.types import NONE, Proposals
from tools.study import ego_drift
from tools.study.filter_consistency import Life, consistency, errors, lives, normalised, study
from tools.study.inheritance import Tally, table_of
from tools.study.truth_replay import majority_bodies, replay


@pytest.fixture(scope="module", name="crossing")
def a_small_crossing():
    """People, cyclists and cars, by a cheap sensor."""
    return SyntheticStream("crossing", "vlp-16", 3.0, seed=1)


def drawn(rng, n, scale):
    """A track that follows a point 0.3 m beside a walker's middle, with errors as its covariance says, scaled."""
    heading = np.full(n, 0.7)
    pose = np.c_[np.arange(n) * 0.1, np.zeros(n), heading, np.full(n, 1.2)]
    A = rng.normal(0, 0.2, (n, 4, 4))
    P = A @ A.transpose(0, 2, 1) + 0.01 * np.eye(4)
    error = scale * np.einsum("nij,nj->ni", np.linalg.cholesky(P), rng.normal(0, 1, (n, 4)))
    beside = 0.3 * np.array([-np.sin(0.7), np.cos(0.7)])
    x = pose + error
    x[:, :2] += beside
    return Life("pedestrian, moving", x, P, pose)


def test_errors_as_large_as_they_should_be_are_consistent_and_others_are_not():
    rng = np.random.default_rng(0)
    for scale, fits in ((1.0, True), (1.6, False), (0.5, False)):
        found = study([drawn(rng, 60, scale) for _ in range(80)])["pedestrian, moving"]
        for part in found.values():
            assert (part.low < part.mean < part.high) is fits
            assert (abs(part.beyond - 0.05) < 0.02) is fits


def test_normalised_errors_are_what_the_slow_way_says():
    life = drawn(np.random.default_rng(1), 7, 1.0)
    place, _ = errors(life)
    slow = [e @ np.linalg.inv(P) @ e for e, P in zip(place, life.P[:, :2, :2], strict=True)]
    np.testing.assert_allclose(normalised(place, life.P[:, :2, :2]), slow)
    np.testing.assert_allclose(consistency([place], [life.P[:, :2, :2]]).mean, np.mean(slow))


def test_a_point_fixed_on_a_body_that_turns_is_no_error():
    heading = np.linspace(0, 2, 9)
    pose = np.c_[np.zeros((9, 2)), heading, np.ones(9)]
    x = pose.copy()
    x[:, :2] = np.c_[np.cos(heading), np.sin(heading)]  # always one metre ahead
    place, _ = errors(Life("car, moving", x, np.tile(np.eye(4), (9, 1, 1)), pose))
    np.testing.assert_allclose(place, 0, atol=1e-12)


@pytest.fixture(scope="module", name="consistencies")
def those_of_the_crossing(crossing):
    return study(lives(crossing, replay(crossing, "vlp-16")))


def test_walkers_are_where_the_filter_says_they_are(consistencies):
    """Two is consistent; it is 5.5 without doubt and by each outline against the last alone."""
    place, motion = consistencies["pedestrian, moving"]["place"], consistencies["pedestrian, moving"]["motion"]
    assert place.tracks >= 10
    assert place.mean < 1.2 * place.high
    assert place.beyond < 0.15
    assert place.rms < 0.15
    assert motion.mean < 2 * motion.high
    assert motion.beyond < 0.15


def test_what_stands_is_where_the_filter_says_it_is(consistencies):
    """Scenery that is seen by stretches slides along what hides it, which no filter of its place can know."""
    for kind, tracks, mean in (("pedestrian, standing", 3, 2.0), ("background, standing", 20, 8.0)):
        place = consistencies[kind]["place"]
        assert place.tracks >= tracks
        assert place.mean < mean
        assert place.beyond < 0.1


def test_both_sides_of_remembered_background_are_counted(crossing):
    kind_of = np.array([int(body.kind.object_class) for body in crossing.simulator.world.bodies])
    on, off = Tally(), Tally()
    on.add(replay(crossing, "vlp-16"), kind_of)
    off.add(replay(crossing, "vlp-16", background_map=NoBackgroundMap()), kind_of)
    assert on.proposals == off.proposals
    assert off.inherited == sum(off.wrong.values()) == len(off.frames_wrong) == 0
    assert 0 < on.inherited <= on.born
    assert on.calls < off.calls
    assert sum(on.wrong.values()) == len(on.frames_wrong) <= on.inherited
    assert all(n >= 1 for n in on.frames_wrong)
    assert table_of(on, off).count("\n") == 6


def test_the_body_of_a_proposal_is_that_of_most_of_its_points():
    instance = np.array([3, 3, 7, NONE, NONE, 7, 7])
    none = np.zeros(3, np.bool_)
    members, offsets = np.arange(7), np.array([0, 3, 5, 7])
    nowhere = np.zeros((3, 7), np.float32)
    proposals = Proposals(members, offsets, nowhere, np.zeros((3, 3)), np.zeros((3, 7)), none)
    body, share = majority_bodies(proposals, instance)
    assert body.tolist() == [3, NONE, 7]
    np.testing.assert_allclose(share, [2 / 3, 1.0, 1.0])
    assert [len(a) for a in majority_bodies(Proposals.empty(), instance)] == [0, 0]


def circle(n, radius=20.0, scale=1.0, turn=1.0):
    angle = np.linspace(0, turn, n)
    place = scale * radius * np.c_[np.sin(angle), 1 - np.cos(angle), np.zeros(n)]
    return np.array([se3(rotation_zyx(0, 0, a), p) for a, p in zip(angle, place, strict=True)])


def test_drift_is_told_by_way_end_and_heading():
    reference = circle(200)
    elsewhere = se3(rotation_zyx(0, 0, 2.0), np.array([5.0, 6.0, 0.0])) @ reference
    assert all(abs(v) < 1e-9 for v in ego_drift.drift(elsewhere, reference).values())
    longer = ego_drift.drift(circle(200, scale=1.02), reference)
    assert longer["way_percent"] == pytest.approx(2.0)
    assert longer["end_percent"] == pytest.approx(2.0 * 2 * np.sin(0.5), rel=1e-4)  # chord over arc
    assert longer["heading_deg"] == pytest.approx(0.0, abs=1e-9)
    assert ego_drift.drift(circle(200, turn=1.01), reference)["heading_deg"] == pytest.approx(np.rad2deg(0.01))


def test_the_drift_of_a_written_drive_is_small_against_positions_and_velocities(tmp_path, monkeypatch, capsys):
    stream = SyntheticStream("street", "vlp-16", 2.0, seed=2)
    writer = DriveWriter(tmp_path, stream)
    for frame, truth in stream.sweeps():
        writer.write(frame, truth)
    writer.close()
    indices = [s.index for s in open_stream(writer.drive).scans]
    positions = np.array([s.T_world_sensor for s in open_stream(writer.drive).scans])
    assert abs(ego_drift.drift(ego_drift.integrated(writer.drive, indices), positions)["end_percent"]) < 0.5
    monkeypatch.setattr(sys, "argv", ["ego_drift", str(writer.drive), str(writer.drive), "--no-kiss"])
    ego_drift.main()
    said = capsys.readouterr().out
    assert "means over 2 drives" in said
    assert "proposals, camera against OXTS positions" in said
    figures = ego_drift.drift(ego_drift.by_proposals(open_stream(writer.drive), camera=False), positions)
    assert abs(figures["heading_deg"]) < 1.0
    assert abs(figures["end_percent"]) < 5.0
