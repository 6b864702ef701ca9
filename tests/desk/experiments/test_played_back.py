from __future__ import annotations

from dataclasses import replace

import numpy as np

from modt.profile import load
from modt_desk.experiments.segmented import PlayedBack, segmented
from tests.desk.experiments.drives import short_drives

DRIVE = short_drives(1)[0]
KNOWN, NEW = (1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0)


class Network:
    def facts(self):
        return {}

    def classify(self, points, proposals, which):
        return np.tile(NEW, (len(which), 1))


def test_what_the_tracker_regroups_is_classified():
    made = segmented(DRIVE, load("hdl-64e"))
    frames = (replace(frame, likelihood=np.tile(KNOWN, (len(frame.proposals), 1))) for frame in made.frames)
    drive = replace(made, frames=tuple(frames), network=Network())
    played = PlayedBack(drive, range_m=30.0)
    for frame in drive.frames:
        points = frame.frame.points
        own = played.segment(points)
        assert 3 < len(own) < len(frame.proposals)
        which = np.array([2, 0, 1])
        np.testing.assert_array_equal(played.classify(points, own, which), [KNOWN, KNOWN, KNOWN])
        box, members = own.box.copy(), own.members.copy()
        box[1, 3] += 0.1
        members[own.offsets[1] - 1] = members[own.offsets[1] - 2]
        changed = replace(own, box=box, members=members)
        np.testing.assert_array_equal(played.classify(points, changed, which), [KNOWN, NEW, NEW])
