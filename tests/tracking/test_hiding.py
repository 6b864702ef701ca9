"""People in hiding: whoever goes behind something and comes out is the same track."""

import numpy as np
import pytest

from modt.classes import ObjectClass
from modt.tracking.hiding import Hiding
from modt.tracking.sight import Sight
from modt.tracking.tuning import SightTuning, TrackingTuning
from modt.types import NONE, Frame, PointKind
from tests.tracking.test_sight import scene
from tests.tracking.tracking_scenes import EYE, Follower, associated, box, tracks_at

PEDESTRIAN = ObjectClass.PEDESTRIAN
BACKGROUND = ObjectClass.BACKGROUND
CAR = ObjectClass.CAR
MEMBER = PointKind.MEMBER
PILLAR = box(5.0, 0.0, 0.3, 1.2, 2.5, z=0.0)
SIGHT = Sight(SightTuning(rays=10**6))


def person(y, x=8.0):
    return box(x, y, 0.5, 0.5, 1.7, z=0.0)


@pytest.mark.parametrize(
    ("at", "kind", "hides"),
    [
        (person(0.0), MEMBER, True),
        (person(0.5), MEMBER, True),
        (person(1.3), MEMBER, False),
        (person(-3.0), MEMBER, False),
        (person(0.0, x=3.0), MEMBER, False),
        (person(0.0), PointKind.GROUND, False),
    ],
    ids=["behind", "behind its end", "beside", "far beside", "before", "ground"],
)
def test_what_is_behind_something_is_hidden(at, kind, hides):
    points, proposals = scene([PILLAR], [kind])
    assert SIGHT.hides(SIGHT.look(points, proposals.kind), np.array([at])).tolist() == [hides]


def test_points_that_are_no_numbers_hide_nothing():
    points, proposals = scene([PILLAR], [MEMBER])
    bad = np.array([[np.inf, 0, 0, 0], [np.nan, 0, 0, 0], [1, -np.inf, 0, 0]], np.float32)
    kind = np.append(proposals.kind, np.full(3, PointKind.OUT_OF_RANGE, np.int8))
    at = np.array([person(0.0), person(-3.0)])
    assert SIGHT.hides(SIGHT.look(np.concatenate([points, bad]), kind), at).tolist() == [True, False]
    assert SIGHT.hides(SIGHT.look(points[:0], proposals.kind[:0]), at).tolist() == [False, False]


def ids_of_walk(ys, pillar=PILLAR):
    """Ids before and after hiding of who is at y in each frame, None where hidden by the pillar."""
    follower = Follower(tuning=TrackingTuning(sight=SIGHT.tuning))
    comes_out = max(i for i, y in enumerate(ys) if y is None) + 1
    ids = []
    for i, y in enumerate(ys):
        boxes = [pillar] if y is None else [pillar, person(y)]
        points, proposals = scene(boxes, [MEMBER] * len(boxes))
        tracks = follower.follow(Frame(i, 0.1 * i, points, EYE), proposals)
        own = np.flatnonzero(tracks.proposal == 1)
        follower.classify(BACKGROUND)
        if len(own):
            follower.set_class(own[0], PEDESTRIAN)
            ids.append((i, int(tracks.id[own[0]])))
    return [n for i, n in ids if i < comes_out][-1], ids[-1][1]


IN = np.arange(-3.0, -0.9, 0.12).tolist()
"""Places on the way in, at 1.2 m/s."""
OUT = np.arange(1.1, 2.0, 0.12).tolist()


@pytest.mark.parametrize("hidden", [10, 20])
def test_who_walks_behind_a_pillar_keeps_the_id(hidden):
    before, after = ids_of_walk([*IN, *[None] * hidden, *OUT])
    assert after == before


def test_who_turns_back_behind_a_pillar_keeps_the_id():
    before, after = ids_of_walk([*IN, *[None] * 20, *IN[::-1][:8]])
    assert after == before


def test_who_comes_out_after_long_is_someone_new():
    before, after = ids_of_walk([*IN, *[None] * 60, *OUT])
    assert after != before


def test_who_leaves_in_the_open_is_forgotten():
    before, after = ids_of_walk([*IN, *[None] * 15, *OUT], pillar=box(-5.0, 0.0, 0.3, 1.2, 2.5, z=0.0))
    assert after != before


def test_the_expected_one_is_continued_first():
    tracks = tracks_at([person(-1.0), person(1.0), person(0.8)], *[PEDESTRIAN] * 3)
    tracks.missed[:2] = 10
    tracks.age[2] = 2
    tracks.x[0, 1] = 1.0  # expected where the other one was seen
    tracks.x[1, 1] = -1.0
    gone = Hiding(SIGHT).merge_returned(tracks)
    assert gone.tolist() == [2]
    assert tracks.missed.tolist() == [0, 10, 0]
    assert tracks.id.tolist() == [0, 1, 2]
    assert tracks.hits[0] == 20
    assert tracks.x[0, 1] == pytest.approx(0.8, abs=0.05)


@pytest.mark.parametrize(
    ("columns", "class_"),
    [({"age": 20}, PEDESTRIAN), ({"missed": 1}, PEDESTRIAN), ({}, CAR)],
    ids=["old", "not seen", "a car"],
)
def test_only_new_people_continue_tracks(columns, class_):
    tracks = tracks_at([person(0.0), person(0.2)], PEDESTRIAN, class_)
    tracks.missed[0] = 10
    tracks.age[1] = 2
    for name, value in columns.items():
        getattr(tracks, name)[1] = value
    assert not len(Hiding(SIGHT).merge_returned(tracks))


def test_the_position_of_a_person_with_a_hidden_side_is_uncertain():
    points, proposals = scene([person(0.75), person(-3.0), PILLAR], [MEMBER] * 3)
    tracks = tracks_at([person(0.75), person(-3.0), PILLAR], PEDESTRIAN, PEDESTRIAN)
    frame = associated(proposals, [0, 1, 2])
    loosened = Hiding(SIGHT).loosened(tracks, frame, SIGHT.look(points, proposals.kind))
    more = (loosened - frame.matches.covariance)[:, 0, 0]
    assert (more > 0).tolist() == [True, False, False]
    assert Hiding(SIGHT).loosened(tracks, frame, None) is frame.matches.covariance


def test_who_is_expected_in_view_stays_in_hiding():
    points, proposals = scene([PILLAR], [MEMBER])
    tracks = tracks_at([person(0.8)], PEDESTRIAN)
    tracks.proposal[:] = NONE
    tracks.moving_mean[:, :2] = tracks.x[:, :2]
    tracks.unseen_s[:] = 0.3
    tracks.x[0, 1] = tracks.moving_mean[0, 1] = 1.3
    tracks.velocity[0, 1] = tracks.moving_mean[0, 3] = 5.0
    Hiding(SIGHT).keep_hidden(tracks, SIGHT.look(points, proposals.kind), EYE, 0.1)
    assert tracks.x[0, 1] == tracks.moving_mean[0, 1] == pytest.approx(0.8)
    assert tracks.unseen_s[0] == pytest.approx(0.2)


def test_the_time_of_an_uncertain_place_counts():
    points, proposals = scene([PILLAR], [MEMBER])
    tracks = tracks_at([person(0.0)], PEDESTRIAN, P=np.eye(4) * 4.0)
    tracks.proposal[:] = NONE
    tracks.unseen_s[:] = 0.3
    Hiding(SIGHT).keep_hidden(tracks, SIGHT.look(points, proposals.kind), EYE, 0.1)
    assert tracks.unseen_s[0] == 0.3
