"""The larger part of an object goes to its most senior track; one seen three times does not join parts."""

import numpy as np
import pytest

from modt.classes import ObjectClass
from modt.geometry.kdop import DIRECTIONS
from modt.types import NONE
from tests.tracking.tracking_scenes import associated, box, frame_of, regrouped, tracks_at

BACKGROUND, CAR, PEDESTRIAN = ObjectClass.BACKGROUND, ObjectClass.CAR, ObjectClass.PEDESTRIAN
WHOLE, REAR, FRONT, NEXT = box(12, 4), box(11.0, 4, l=1.9), box(13.3, 4, l=1.3), box(17.4, 4)


def ranked(boxes, *classes, points=None, hits=3):
    """Tracks at boxes. By default the first has had most points, and so on."""
    tracks = tracks_at(boxes, *classes, hits=hits)
    tracks.points[:] = 100 * np.arange(len(tracks), 0, -1) if points is None else points
    return tracks


def reunited(tracks, boxes, rows, points):
    """Proposal of each track after regrouping, where the first proposals were matched with the rows given."""
    matches = regrouped(tracks, associated(frame_of(boxes, points=points)[1], rows)).matches
    proposal = np.full(len(tracks), NONE)
    proposal[matches.rows] = matches.proposals
    return proposal.tolist(), matches


@pytest.mark.parametrize(
    ("known", "seen", "rows", "points", "columns", "proposals"),
    [
        ([WHOLE, FRONT], [REAR, FRONT], [0, 1], (80, 40), {}, [0, 1]),  # has the larger part already
        ([WHOLE, FRONT], [REAR, FRONT], [1, 0], (40, 80), {}, [1, 0]),  # likewise
        ([WHOLE, FRONT], [REAR, FRONT], [0, 1], (40, 80), {}, [1, 0]),
        ([WHOLE, FRONT], [REAR, FRONT], [0, 1], (40, 80), {"points": (70, 90), "hits": (3, 2)}, [1, 0]),
        ([WHOLE, FRONT], [REAR, FRONT], [0, 1], (40, 80), {"points": (70, 90), "hits": (2, 2)}, [0, 1]),
        ([WHOLE, WHOLE, FRONT], [FRONT], [2], 80, {"points": (50, 500, 5)}, [NONE, 0, NONE]),
        ([WHOLE], [REAR, FRONT], [0], (40, 80), {}, [1]),  # the part had no track
        ([FRONT, WHOLE], [WHOLE], [1], 80, {}, [0, NONE]),  # the senior track has seen a fragment only
        ([WHOLE, FRONT], [REAR, FRONT], [0, 1], (40, 80), {"hits": 1}, [0, 1]),  # it was seen once
        ([WHOLE, NEXT], [REAR, NEXT], [0, 1], (40, 80), {}, [0, 1]),  # together longer than a car
        ([WHOLE], [], [], 0, {}, [NONE]),
        # background and cars are easily confused, people and cars are not
        ([WHOLE, FRONT], [REAR, FRONT], [0, 1], (40, 80), {"classes": (BACKGROUND, CAR)}, [1, 0]),
        ([WHOLE, FRONT], [REAR, FRONT], [0, 1], (40, 80), {"classes": (CAR, PEDESTRIAN)}, [0, 1]),
        ([WHOLE, FRONT], [REAR, FRONT], [0, 1], (40, 80), {"classes": (BACKGROUND, PEDESTRIAN)}, [0, 1]),
    ],
)
def test_the_most_senior_track_takes_the_largest_part(known, seen, rows, points, columns, proposals):
    classes = columns.pop("classes", [CAR] * len(known))
    assert reunited(ranked(known, *classes, **columns), seen, rows, points)[0] == proposals


def test_a_lost_track_takes_the_part_and_its_former_owner_is_lost():
    tracks = ranked([WHOLE, FRONT], CAR, CAR)
    proposal, matches = reunited(tracks, [FRONT], [1], 40)
    assert proposal == [0, NONE]
    np.testing.assert_allclose(matches.position[0], tracks.x[0, :2])  # a part measures nothing
    assert matches.covariance[0, 0, 0] >= 100


@pytest.mark.parametrize(("length_m", "swapped"), [(1.5, True), (3.5, False)])
def test_parts_that_are_longer_than_their_class_together_are_not_one_object(length_m, swapped):
    """Both lie within the known extent, which once was that of a merged object."""
    part = box(14.2 + length_m / 2, 4, length_m)
    tracks = ranked([WHOLE, part], CAR, CAR)
    tracks.envelope[0] += 6 * np.maximum(DIRECTIONS[0], 0)
    assert (reunited(tracks, [REAR, part], [0, 1], (40, 80))[0] == [1, 0]) == swapped
