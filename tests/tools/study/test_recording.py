"""Recordings of drives."""

from __future__ import annotations

import numpy as np
import pytest

from modt import profile
from modt.classes import ObjectClass
from modt.classification.fusion import EveryFrame
from modt.classification.prior import FrequencyPrior
from modt.geometry import FieldOfView
from modt.types import NONE, Proposals
from tools.study.fusion_replay import replay
from tools.study.recording import owners, record
from tools.train.labelled_scans import Scan
from tools.train.synthetic_scans import labelled_scan


def test_the_ideal_tracker_takes_the_largest_fragment_of_an_object() -> None:
    box, none, points = np.zeros((4, 7)), np.zeros(4, np.bool_), np.zeros((40, 4), np.float32)
    offsets = np.array([0, 10, 30, 35, 40])
    proposals = Proposals(np.arange(40), offsets, points[:, :3].T, np.zeros((4, 3)), box, none)
    car, rider = np.arange(2, 28), np.arange(36, 40)  # pieces of 8 and of 18 points; 4 of 5 points
    kinds = (ObjectClass.CAR, ObjectClass.CYCLIST)
    unlabelled = np.zeros(40, np.bool_)
    scan = Scan("s", "d", points, (car, rider), kinds, np.zeros((2, 7)), FieldOfView(), unlabelled, (70, 8))
    assert owners(scan, proposals).tolist() == [NONE, 70, NONE, 8]


@pytest.mark.slow
def test_a_recording_has_one_track_per_body() -> None:
    from modt.classification.pointnet import PointNet
    from modt_desk.simulation.synthetic_stream import SyntheticStream

    config = profile.load()
    network = PointNet(config.classification, config.sensor)
    sweeps = list(SyntheticStream("crossing", "hdl-64e", 0.4, 7).sweeps())
    drive = [(frame, labelled_scan(frame, truth, "x", "x", camera=True)) for frame, truth in sweeps]
    recording = record("x", drive, config, network, FrequencyPrior(config.fusion.prior))
    assert len(recording.frames) == 4
    bodies: dict[int, set[int]] = {}
    for recorded, (frame, scan) in zip(recording.frames, drive, strict=True):
        assert len(np.unique(recorded.track)) == len(recorded.track)
        np.testing.assert_allclose(recorded.likelihood.sum(axis=1), 1.0, atol=1e-5)
        for body, track in zip(owners(scan, recorded.proposals).tolist(), recorded.track.tolist(), strict=True):
            if body != NONE:
                bodies.setdefault(body, set()).add(track)
        again = network.classify(frame.points, recorded.proposals, np.arange(len(recorded.proposals)))
        assert again.tobytes() == recorded.likelihood.tobytes()
    assert bodies
    assert all(len(tracks) == 1 for tracks in bodies.values())
    assert replay([recording], lambda prior: EveryFrame(), 1).share == 1.0
    own = record("x", drive, config, network, FrequencyPrior(config.fusion.prior), ideal=False)
    for recorded, ideal in zip(own.frames, recording.frames, strict=True):
        assert len(np.unique(recorded.track)) == len(recorded.track)
        assert (recorded.scored | ~ideal.scored).all()
    assert sum(int(m.scored.sum()) for m in own.frames) > sum(int(m.scored.sum()) for m in recording.frames)
