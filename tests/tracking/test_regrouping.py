"""Every point stays in one proposal, and boxes and observations follow the points."""

import dataclasses

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from modt.classes import ObjectClass
from modt.observations import observe
from tests.tracking.tracking_scenes import EYE, associated, box, frame_of, joined, regrouped, tracks_at

POINTS = 60


@st.composite
def scenes(draw):
    """Tracks of cars and people, and proposals of cut cars, joined people and what nobody knows."""
    rng = np.random.default_rng(draw(st.integers(0, 2**16)))
    known, seen, groups = [], [], []
    for k in range(draw(st.integers(1, 3))):
        x, kind = 8.0 * k + 8, draw(st.sampled_from(["cut", "touching", "whole"]))
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
def test_every_member_stays_once_with_its_coordinates_and_proposals_and_tracks_are_pairs(scene):
    frame = regrouped(*scene)
    before, after = scene[1].proposals, frame.proposals
    assert (after.count > 0).all()
    for rows in (frame.matches.rows, frame.matches.proposals):
        assert len(np.unique(rows)) == len(rows)
    old, new = before.members.argsort(), after.members.argsort()
    np.testing.assert_array_equal(before.members[old], after.members[new])
    np.testing.assert_array_equal(before.coordinates[:, old], after.coordinates[:, new])


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
                np.testing.assert_array_equal(
                    getattr(after.proposals, column)[q], getattr(frame.proposals, column)[p], err_msg=column
                )
        else:
            xyz = after.proposals.coordinates[:, a:b]
            np.testing.assert_allclose(after.proposals.centroid[q], xyz.mean(axis=1), atol=1e-5)
            height = (after.proposals.box[q, 2] - after.proposals.box[q, 5] / 2, xyz[2].min())
            np.testing.assert_allclose(*height, atol=1e-5)
            assert after.observations.count[q] == b - a
    whole = ~np.isnan(after.proposals.reflectance[:, 0])
    np.testing.assert_allclose(after.observations.kdop[:, whole], fresh.kdop[:, whole], atol=1e-5)


@given(scenes())
def test_the_frame_before_is_left_as_it_was(scene):
    tracks, frame = scene
    columns = (frame.proposals.box, frame.proposals.centroid, frame.observations.box, frame.observations.kdop)
    before = [column.copy() for column in columns]
    regrouped(tracks, frame)
    for was, column in zip(before, columns, strict=True):
        np.testing.assert_array_equal(column, was)
