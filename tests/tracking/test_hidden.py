"""A person of whom the view cuts off the upper half keeps size, class and track; the legs are one object."""

from dataclasses import replace

import numpy as np
import pytest

from modt.classes import ObjectClass
from modt.types import Cut
from tests.tracking.tracking_scenes import Follower, box, frame_of

PEDESTRIAN = ObjectClass.PEDESTRIAN
BACKGROUND = ObjectClass.BACKGROUND
WHOLE = box(1.0, 0.0, 0.6, 0.6, 1.7, z=-0.15)
LOWER = box(1.0, 0.0, 0.6, 0.6, 0.6, z=-0.7)
LEGS = [box(1.0, y, 0.15, 0.15, 0.6, z=-0.7) for y in (-0.2, 0.2)]


def follow(follower, boxes, i, cut=0, object_class=PEDESTRIAN):
    frame, proposals = frame_of(boxes, i)
    follower.follow(frame, replace(proposals, cut=np.full(len(boxes), int(cut))))
    follower.classify(object_class, BACKGROUND)
    return follower.tracks


def followed(object_class=PEDESTRIAN):
    follower = Follower()
    for i in range(6):
        follow(follower, [WHOLE], i, object_class=object_class)
    return follower


@pytest.mark.parametrize(
    ("cut", "lower", "object_class", "top_cut"),
    [
        (Cut.TOP, LOWER, PEDESTRIAN, True),
        (Cut.TOP | Cut.NEAR, LOWER, PEDESTRIAN, True),
        (Cut(0), LOWER, PEDESTRIAN, False),
        (Cut.BOTTOM, LOWER, PEDESTRIAN, False),
        (Cut.TOP, box(1.0, 0.0, 0.6, 0.6, 1.2, z=-0.4), PEDESTRIAN, False),
        (Cut.TOP, LOWER, BACKGROUND, False),
    ],
)
def test_a_person_is_hidden_while_the_view_cuts_off_the_upper_half(cut, lower, object_class, top_cut):
    follower = followed(object_class)
    tracks = follow(follower, [lower], 6, cut)
    assert tracks.top_cut.tolist() == [top_cut]
    height_m = WHOLE[5] if object_class == PEDESTRIAN and cut & Cut.TOP else lower[5]  # as before, or as it is seen
    for of in (tracks.box[0], follower.proposals.box[0]):
        assert (of[5], of[2] - of[5] / 2) == (pytest.approx(height_m), pytest.approx(-1.0))
    assert not follow(follower, [WHOLE], 7).top_cut.any()


def test_two_legs_are_one_object_as_high_as_the_person():
    follower = followed()
    follow(follower, [LOWER], 6, Cut.TOP)
    for i in range(7, 12):
        tracks = follow(follower, LEGS, i, Cut.TOP)
        assert tracks.id.tolist() == [0]
        assert follower.proposals.count.tolist() == [120]
        assert follower.proposals.box[0, 5] == pytest.approx(1.7, abs=0.05)


def test_a_leg_that_has_a_track_of_its_own_comes_back_to_the_person():
    follower = followed()
    tracks = follow(follower, LEGS, 6, Cut.TOP)  # nobody knows yet that these are legs
    assert len(tracks) == 2
    tracks = follow(follower, LEGS, 7, Cut.TOP)
    assert follower.proposals.count.tolist() == [120]
    assert tracks.proposal[0] == 0


def test_the_legs_of_a_person_in_full_view_are_no_reason_to_join_things():
    follower = followed()
    follow(follower, [LOWER], 6)
    follow(follower, LEGS, 7)
    assert len(follower.proposals) == 2
