"""Parts of an object are regrouped: points stay once, boxes and observations follow, the senior track takes most."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from modt.classes import ObjectClass
from modt.geometry.kdop import DIRECTIONS
from modt.observations import observe
from modt.types import NONE
from tests.tracking.tracking_scenes import EYE, associated, box, frame_of, joined, regrouped, tracks_at

BACKGROUND, CAR, PEDESTRIAN, _ = ObjectClass
WHOLE = box(12, 4)
REAR = box(11.0, 4, l=1.9)
FRONT = box(13.3, 4, l=1.3)
NEXT = box(17.4, 4)


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
        ([WHOLE, WHOLE, FRONT], [FRONT], [2], 80, {"points": (50, 500, 5)}, [NONE, 0, NONE]),
        ([WHOLE], [REAR, FRONT], [0], (40, 80), {}, [1]),  # the part had no track
        ([FRONT, WHOLE], [WHOLE], [1], 80, {}, [0, NONE]),  # the senior track has seen a fragment only
        ([WHOLE, NEXT], [REAR, NEXT], [0, 1], (40, 80), {}, [0, 1]),  # together longer than a car
        ([WHOLE], [], [], 0, {}, [NONE]),
    ],
)
def test_the_most_senior_track_takes_the_largest_part(known, seen, rows, points, columns, proposals):
    assert reunited(ranked(known, *[CAR] * len(known), **columns), seen, rows, points)[0] == proposals


@pytest.mark.parametrize(
    ("classes", "columns", "proposals"),
    [
        ((CAR, CAR), {}, [1, 0]),
        ((CAR, CAR), {"points": (70, 90), "hits": (3, 2)}, [1, 0]),
        ((CAR, CAR), {"points": (70, 90), "hits": (2, 2)}, [0, 1]),
        ((CAR, CAR), {"hits": 1}, [0, 1]),  # it was seen once
        # background and cars are easily confused, people and cars are not
        ((BACKGROUND, CAR), {}, [1, 0]),
        ((CAR, PEDESTRIAN), {}, [0, 1]),
        ((BACKGROUND, PEDESTRIAN), {}, [0, 1]),
    ],
)
def test_a_whole_car_with_the_smaller_of_two_parts_takes_the_larger_one(classes, columns, proposals):
    tracks = ranked([WHOLE, FRONT], *classes, **columns)
    assert reunited(tracks, [REAR, FRONT], [0, 1], (40, 80))[0] == proposals


def test_a_lost_track_takes_the_part_and_its_former_owner_is_lost():
    tracks = ranked([WHOLE, FRONT], CAR, CAR)
    proposal, matches = reunited(tracks, [FRONT], [1], 40)
    assert proposal == [0, NONE]
    assert_allclose(matches.position[0], tracks.x[0, :2])  # a part measures nothing
    assert matches.covariance[0, 0, 0] >= 100


@pytest.mark.parametrize(("length_m", "swapped"), [(1.5, True), (3.5, False)])
def test_parts_that_are_longer_than_their_class_together_are_not_one_object(length_m, swapped):
    """Both lie within the known extent, which once was that of a merged object."""
    part = box(14.2 + length_m / 2, 4, length_m)
    tracks = ranked([WHOLE, part], CAR, CAR)
    tracks.envelope[0] += 6 * np.maximum(DIRECTIONS[0], 0)
    assert (reunited(tracks, [REAR, part], [0, 1], (40, 80))[0] == [1, 0]) == swapped


POINTS = 60


@st.composite
def scenes(draw):
    """Tracks of cars and people, and proposals of cut cars, joined people and what nobody knows."""
    rng = np.random.default_rng(draw(st.integers(0, 2**16)))
    known = []
    seen = []
    groups = []
    for k in range(draw(st.integers(1, 3))):
        x = 8.0 * k + 8
        kind = draw(st.sampled_from(["cut", "touching", "whole"]))
        first = len(seen)
        if kind == "touching":
            known.append(box(x, 2.5, 0.6, 0.6, 1.7, z=-0.85))
            seen += [known[-1], box(x, 3.1, 6.0, 0.3, 2.5, z=-0.5)]
            groups.append((first, first + 1))
        elif kind == "cut":
            known.append(box(x, 3, 4.2))
            seen += [box(x - 1.4, 3, 1.4), box(x + 1.1, 3, 2.0)]
            groups += [(first,), (first + 1,)]
        else:
            known.append(box(x, 3))
            seen.append(known[-1])
            groups.append((first,))
    classes = [ObjectClass.PEDESTRIAN if b[3] < 1 else ObjectClass.CAR for b in known]
    tracks = tracks_at(known, *classes, points=POINTS)
    proposals = joined(frame_of(seen, points=POINTS)[1], groups)
    n = len(groups)
    proposals = dataclasses.replace(proposals, reflectance=np.arange(5.0 * n).reshape(n, 5), ground_z_m=-np.ones(n))
    matched = [k for k in range(min(n, len(known))) if draw(st.booleans())]
    tracks.x[:, :2] += rng.normal(0, 0.05, (len(tracks), 2))
    return tracks, associated(proposals, matched, matched)


@given(scenes())
def test_every_point_stays_in_one_proposal_with_its_coordinates_and_proposals_and_tracks_are_pairs(scene):
    frame = regrouped(*scene)
    before = scene[1].proposals
    after = frame.proposals
    assert (after.count > 0).all()
    for rows in (frame.matches.rows, frame.matches.proposals):
        assert len(np.unique(rows)) == len(rows)
    old = before.members.argsort()
    new = after.members.argsort()
    assert_array_equal(before.members[old], after.members[new])
    assert_array_equal(before.coordinates[:, old], after.coordinates[:, new])


@given(scenes())
def test_what_did_not_change_keeps_its_columns_and_boxes_enclose_what_did(scene):
    tracks, frame = scene
    after = regrouped(tracks, frame)
    fresh = observe(after.proposals, EYE)
    groups = [part.tolist() for part in np.split(frame.proposals.members, frame.proposals.offsets[1:-1])]
    for q, (a, b) in enumerate(zip(after.proposals.offsets, after.proposals.offsets[1:], strict=False)):
        members = after.proposals.members[a:b].tolist()
        if members in groups:
            p = groups.index(members)
            for column in ("box", "centroid", "reflectance", "ground_z_m"):
                assert_array_equal(
                    getattr(after.proposals, column)[q], getattr(frame.proposals, column)[p], err_msg=column
                )
        else:
            xyz = after.proposals.coordinates[:, a:b]
            assert_allclose(after.proposals.centroid[q], xyz.mean(axis=1), atol=1e-5)
            height = (after.proposals.box[q, 2] - after.proposals.box[q, 5] / 2, xyz[2].min())
            assert_allclose(*height, atol=1e-5)
            assert after.observations.count[q] == b - a
    whole = ~np.isnan(after.proposals.reflectance[:, 0])
    assert_allclose(after.observations.kdop[:, whole], fresh.kdop[:, whole], atol=1e-5)


@given(scenes())
def test_the_frame_before_is_left_as_it_was(scene):
    tracks, frame = scene
    columns = (frame.proposals.box, frame.proposals.centroid, frame.observations.box, frame.observations.kdop)
    before = [column.copy() for column in columns]
    regrouped(tracks, frame)
    for was, column in zip(before, columns, strict=True):
        assert_array_equal(column, was)
