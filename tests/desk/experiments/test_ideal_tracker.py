from __future__ import annotations

import numpy as np
import pytest

from modt.profile import load
from modt_desk.experiments.figures import ObjectLives
from modt_desk.experiments.judged import NetworkReplay
from tests.desk.experiments.drives import short_drives

DRIVE = short_drives(1, frames=6)[0]


@pytest.mark.slow
def test_the_ideal_tracker_never_breaks_a_life_that_it_follows():
    ideal = NetworkReplay(load("hdl-64e"), ideal=True).judged(DRIVE)
    found = ideal.objects[ideal.objects["outcome"] == 0]
    for id_ in np.unique(found["id"]):
        assert len(np.unique(found["track"][found["id"] == id_])) == 1
    assert ObjectLives.of(ideal).followed.sum() > 0


def test_with_an_ideal_tracker_tracking_by_detection_calls_every_proposal():
    replay = NetworkReplay(load("hdl-64e"), "conventional", ideal=True)
    found = replay.judged(DRIVE)
    assert len(found.calls) == found.frames["proposals"].sum()


def test_beyond_the_range_of_interest_there_is_nothing():
    for ideal in (True, False):
        replay = NetworkReplay(load("hdl-64e"), ideal=ideal, range_m=20.0)
        found = replay.judged(DRIVE).proposals
        assert len(found)
        assert found["range_m"][found["label"] == 0].max() <= 25.0
