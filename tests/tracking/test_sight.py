"""Lines of sight: which ends of a proposal something nearer makes, or the same surface."""

import numpy as np
import pytest

from modt.tracking.sight import Sight
from modt.tracking.tuning import SightTuning
from modt.types import PointKind, Proposals
from tests.tracking.tracking_scenes import box, frame_of

HEIGHT_M = 1.4
FRONT = 10.0


def wall(y_from, y_to, x=FRONT):
    """Box of an upright surface across the line of sight."""
    return box(x, (y_from + y_to) / 2, y_to - y_from, 0.1, HEIGHT_M, yaw=np.pi / 2, z=0.0)


def scene(boxes, kinds):
    """Points and proposals of boxes full of points; those that are no members are not proposals."""
    frame, all_proposals = frame_of(boxes, points=3000)
    kind = np.repeat(np.array(kinds, np.int8), all_proposals.count)
    n = sum(1 for each in kinds if each == PointKind.MEMBER)
    last = all_proposals.offsets[n]
    proposals = Proposals(
        members=all_proposals.members[:last],
        offsets=all_proposals.offsets[: n + 1],
        coordinates=all_proposals.coordinates[:, :last].copy(),
        centroid=all_proposals.centroid[:n],
        box=all_proposals.box[:n],
        cut=all_proposals.cut[:n],
        kind=kind,
    )
    return frame.points, proposals


SUBJECT = wall(-1.0, 1.0)
HIDES_LEFT = wall(0.5, 0.9, x=5.0)
HIDES_RIGHT = wall(-0.9, -0.5, x=5.0)
BEHIND = wall(-6.0, 6.0, x=14.0)
GOES_ON = wall(1.0, 4.0)
LOW = box(5.0, 0.7, 0.4, 0.4, 0.3, z=-1.3)
MEMBER, STRUCTURE, GROUND = PointKind.MEMBER, PointKind.STRUCTURE, PointKind.GROUND


@pytest.mark.parametrize(
    ("others", "kinds", "sides"),
    [
        ([], [], 0),
        ([BEHIND], [STRUCTURE], 0),
        ([HIDES_LEFT], [STRUCTURE], 1),
        ([HIDES_LEFT, HIDES_RIGHT], [STRUCTURE, STRUCTURE], 2),
        ([HIDES_LEFT, HIDES_RIGHT], [STRUCTURE, MEMBER], 2),
        ([HIDES_LEFT], [GROUND], 0),
        ([GOES_ON], [STRUCTURE], 1),
        ([LOW], [PointKind.LOW], 0),
    ],
    ids=["alone", "wall behind", "hidden", "between", "between things", "ground", "goes on", "low before it"],
)
def test_bounded_sides(others, kinds, sides):
    members_first = sorted(zip(kinds, others, strict=True), key=lambda pair: pair[0] != MEMBER)
    boxes = [SUBJECT, *(other for _, other in members_first)]
    points, proposals = scene(boxes, [MEMBER, *(kind for kind, _ in members_first)])
    sight = Sight(SightTuning(rays=10**6))
    found = sight.bounded_sides(sight.look(points, proposals.kind), proposals, np.array([0]))
    assert found.sum(axis=1).tolist() == [sides]
