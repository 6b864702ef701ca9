from __future__ import annotations

import dataclasses

import numpy as np

from modt.profile import load
from modt_desk.experiments.played_back import PlayedBack
from modt_desk.experiments.replays import NetworkReplay
from modt_desk.experiments.segmented import segmented
from modt_desk.experiments.store import Store
from tests.desk.experiments.drives import short_drives

DRIVE = short_drives(1)[0]
KNOWN, NEW = (1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0)


class Network:
    def facts(self):
        return {}

    def classify(self, points, proposals, which):
        return np.tile(NEW, (len(which), 1))


def test_what_the_tracker_regroups_is_classified(tmp_path):
    drive = segmented(DRIVE, DRIVE.digest(), load("hdl-64e"), Store(tmp_path))
    known = [np.tile(KNOWN, (len(frame.proposals), 1)) for frame in drive.frames]
    played = PlayedBack(drive, known, Network(), range_m=30.0)
    for frame in drive.frames:
        points = frame.frame.points
        own = played.segment(points)
        assert 3 < len(own) < len(frame.proposals)
        which = np.array([2, 0, 1])
        np.testing.assert_array_equal(played.classify(points, own, which), [KNOWN, KNOWN, KNOWN])
        box, members = own.box.copy(), own.members.copy()
        box[1, 3] += 0.1
        members[own.offsets[1] - 1] = members[own.offsets[1] - 2]
        changed = dataclasses.replace(own, box=box, members=members)
        np.testing.assert_array_equal(played.classify(points, changed, which), [KNOWN, NEW, NEW])


def test_the_network_runs_once_for_all_replays(tmp_path, monkeypatch):
    store, config = Store(tmp_path), load("paper")
    NetworkReplay(config, ideal=True).judged(DRIVE, DRIVE.digest(), store)
    monkeypatch.setattr("modt.classification.pointnet.PointNet.infer", None)
    assert len(NetworkReplay(config, "conventional").judged(DRIVE, DRIVE.digest(), store).calls) > 100
