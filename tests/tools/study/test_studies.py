"""Drift of ego-motion, consistency of the filter, and tables over mounts, boards and sensors."""

import sys

import numpy as np
import pytest

from modt.classes import ObjectClass
from modt.geometry import rotation_zyx, se3
from modt.sources.recognise import open_stream
from modt_simulation.synthetic_stream import SyntheticStream
from modt_training.simulated import simulated_scans
from tests.recorded import written
from tools.study import ego_drift, mounts
from tools.study.boards import BOARDS, Work, rating_of, table
from tools.study.drives import simulated
from tools.study.filter_consistency import BodyTrack, body_tracks, study
from tools.study.segmentation_recall import Tally


def circle(n, radius=20.0, scale=1.0, turn=1.0):
    angle = np.linspace(0, turn, n)
    position = scale * radius * np.c_[np.sin(angle), 1 - np.cos(angle), np.zeros(n)]
    return np.array([se3(rotation_zyx(0, 0, a), p) for a, p in zip(angle, position, strict=True)])


def test_drift_in_path_end_and_heading():
    reference = circle(200)
    moved = se3(rotation_zyx(0, 0, 2.0), np.array([5.0, 6.0, 0.0])) @ reference
    assert all(abs(v) < 1e-9 for v in ego_drift.drift(moved, reference).values())
    longer = ego_drift.drift(circle(200, scale=1.02), reference)
    assert longer["path_percent"] == pytest.approx(2.0)
    assert longer["end_percent"] == pytest.approx(2.0 * 2 * np.sin(0.5), rel=1e-4)  # chord over arc
    assert longer["heading_deg"] == pytest.approx(0.0, abs=1e-9)
    assert ego_drift.drift(circle(200, turn=1.01), reference)["heading_deg"] == pytest.approx(np.rad2deg(0.01))


@pytest.mark.slow
def test_the_drift_of_a_written_drive_is_small_against_positions_and_velocities(tmp_path, monkeypatch, capsys):
    drive = written(tmp_path, SyntheticStream("street", "vlp-16", 1.0, seed=2)).drive
    scans = open_stream(drive).scans
    positions = np.array([s.T_world_sensor for s in scans])
    integrated = ego_drift.integrated(drive, [s.index for s in scans])
    assert abs(ego_drift.drift(integrated, positions)["end_percent"]) < 0.5
    monkeypatch.setattr(sys, "argv", ["ego_drift", str(drive), str(drive)])
    ego_drift.main()
    said = capsys.readouterr().out
    assert "means over 2 drives" in said
    assert "proposals, camera against OXTS positions" in said
    figures = ego_drift.drift(ego_drift.by_proposals(open_stream(drive), camera=False), positions)
    assert abs(figures["heading_deg"]) < 1.0
    assert abs(figures["end_percent"]) < 5.0


def random_track(rng, n, scale):
    """A track 0.3 m beside the centre of a walker, with random errors of `scale` times its covariance."""
    heading = np.full(n, 0.7)
    pose = np.c_[np.arange(n) * 0.1, np.zeros(n), heading, np.full(n, 1.2)]
    A = rng.normal(0, 0.2, (n, 4, 4))
    P = A @ A.transpose(0, 2, 1) + 0.01 * np.eye(4)
    error = scale * np.einsum("nij,nj->ni", np.linalg.cholesky(P), rng.normal(0, 1, (n, 4)))
    beside = 0.3 * np.array([-np.sin(0.7), np.cos(0.7)])
    velocity = 1.2 * np.column_stack([np.cos(heading), np.sin(heading)])
    x = np.c_[pose[:, :2], velocity] + error
    x[:, :2] += beside
    return BodyTrack("pedestrian, moving", x, P, pose)


def test_errors_are_consistent_only_at_the_scale_of_their_covariance(rng):
    for scale, fits in ((1.0, True), (1.6, False), (0.5, False)):
        found = study([random_track(rng, 60, scale) for _ in range(80)])["pedestrian, moving"]
        for part in found.values():
            assert (part.low < part.mean < part.high) is fits
            assert (abs(part.beyond - 0.05) < 0.02) is fits


@pytest.fixture(scope="module", name="consistencies")
def consistencies_on_drives():
    drives = [SyntheticStream(scene, "vlp-16", 3.0, seed) for scene in ("crossing", "street") for seed in range(1, 5)]
    return study([track for drive in drives for track in body_tracks(drive, "vlp-16")])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "tracks", "mean", "beyond"),
    [
        ("pedestrian, moving", 25, 3.0, 0.15),
        ("pedestrian, standing", 5, 2.0, 0.1),
        ("background, standing", 40, 12.0, 0.1),  # no filter models the motion of a visible part along what hides it
    ],
)
def test_the_filter_is_nearly_consistent(kind, tracks, mean, beyond, consistencies):
    """A consistent filter has a mean of 2. Displacements from consecutive outlines alone give 5.5 for walkers."""
    for part, found in consistencies[kind].items():
        assert found.tracks >= tracks
        assert found.mean < (mean if part == "position" else 2 * found.high)
        assert found.beyond < beyond


@pytest.mark.slow
def test_a_row_over_mounts_has_recall_and_precision_of_people():
    drive = simulated("crowd", "vlp-16", 1.0, 3, height_m=0.8, mount_deg=(0.0, 10.0))
    judged = mounts.run(drive, "accurate", mounts.of_mount("vlp-16", 0.8))
    *_, people, _cars = mounts.row("vlp-16", [judged]).strip("| ").split(" | ")
    number, _, shares = people.partition(": ")
    detected, recall, precision = map(int, shares.split(" / "))
    assert int(number) > 10
    assert 50 < recall <= detected <= 100
    assert 50 < precision <= 100


def test_times_on_boards_are_scaled_by_their_ratings_at_full_usage():
    printed = "Avr:       711    25   3041    751\nTot:              27   3319    886\n"
    assert rating_of(printed) == 3319
    with pytest.raises(ValueError, match="no line Tot"):
        rating_of(printed.replace("Tot", "Sum"))
    *_, row = table([Work("os1-64", "accurate", 65536.4, 120.0, 3.25, 6.0)], 4 * 1752).splitlines()
    assert "24 ms" in row
    assert row.count("|") == 5 + len(BOARDS) + 1


def test_objects_of_a_scan_are_counted_by_class():
    (scan,) = simulated_scans(["street"], [3], [0.0], camera=False, sensors=["vlp-16"])
    tally = Tally()
    tally.add(scan)
    visible = [k for k, own in zip(scan.kinds, scan.objects, strict=True) if len(own) >= 20]
    assert tally.objects.tolist() == np.bincount(visible, minlength=4).tolist()
    assert tally.objects[ObjectClass.CAR] > 3
    assert tally.detected[ObjectClass.CAR] > 0.5 * tally.objects[ObjectClass.CAR]
    assert (tally.detected <= tally.objects).all()
    assert "x" in tally.row("x")
