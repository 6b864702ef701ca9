"""One way to regroup proposals: every member stays, boxes and observations follow the points."""

import dataclasses
import itertools

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from modt.geometry import corners
from modt.observations import observe
from modt.placement import Placement
from modt.tracking.association import Matches
from modt.tracking.regrouping import Associated, Grouping, runs_of
from tests.tracking.tracking_scenes import EYE, box, driving, frame_of

NO_MATCHES = Matches(*(np.zeros((0, *shape)) for shape in ((), (), (2,), (2, 2), (4,))))


@dataclasses.dataclass
class Scene:
    """A frame, and a grouping of its members drawn at random."""

    points: np.ndarray
    frame: Associated
    placement: Placement
    deskew: np.ndarray
    label: np.ndarray
    grouping: Grouping


@st.composite
def scenes(draw):
    """Proposals of which some members go to other groups; those of an unchanged one keep their order."""
    n = draw(st.integers(1, 6))
    frame, proposals = frame_of([box(6 * k + 5, k, yaw=0.3 * k) for k in range(n)], points=draw_counts(draw, n))
    proposals = dataclasses.replace(
        proposals,
        cut=np.arange(n) % 3,
        reflectance=np.arange(5.0 * n).reshape(n, 5),
        ground_z_m=-1.0 - np.arange(n),
    )
    placement = Placement(driving(draw(st.integers(0, 5))) if draw(st.booleans()) else EYE)
    deskew = np.random.default_rng(n).uniform(-0.3, 0.3, (n, 2))
    observations = observe(proposals, placement.T_world_sensor).moved(deskew)
    label = np.repeat(np.arange(n), proposals.count)
    for _ in range(draw(st.integers(0, 3))):  # split off some points, or merge one proposal with another
        host, part = draw(st.integers(0, label.max())), draw(st.integers(0, label.max()))
        own = np.flatnonzero(label == host)
        if draw(st.booleans()) and len(own) > 3:
            label[own[:: draw(st.integers(2, 3))]] = label.max() + 1
        else:
            label[label == part] = host
    label = np.unique(label, return_inverse=True)[1]
    members = [np.flatnonzero(label == q) for q in range(label.max() + 1)]
    source = np.array([np.searchsorted(proposals.offsets, m[0], side="right") - 1 for m in members])
    same = [np.array_equal(m, np.arange(*proposals.offsets[k : k + 2])) for m, k in zip(members, source, strict=True)]
    changed = np.flatnonzero(~np.array(same))
    yaw = draw(st.floats(-3, 3))
    runs = runs_of(np.concatenate(members))
    grouping = Grouping(runs, np.bincount(label), source, changed, np.full(len(changed), yaw))
    return Scene(frame.points, Associated(proposals, observations, NO_MATCHES), placement, deskew, label, grouping)


def draw_counts(draw, n):
    return draw(st.lists(st.integers(6, 14), min_size=n, max_size=n))


def sorted_rows(xyz):
    return xyz[np.lexsort(xyz.T)]


@given(scenes())
def test_every_member_stays_once_with_its_coordinates(scene):
    before = scene.frame.proposals
    after, observations = scene.grouping.apply(scene.frame, scene.placement)
    np.testing.assert_array_equal(np.sort(after.members), np.sort(before.members))
    np.testing.assert_array_equal(after.coordinates.T, scene.points[after.members, :3])
    np.testing.assert_array_equal(after.count, np.bincount(scene.label))
    np.testing.assert_array_equal(after.label(len(scene.points)), scene.label)
    np.testing.assert_array_equal(observations.count, after.count)


@given(scenes())
def test_boxes_hold_their_points_and_centroids_are_their_means(scene):
    after, _ = scene.grouping.apply(scene.frame, scene.placement)
    for row in range(len(after)):
        xyz = scene.points[scene.label == row, :3].astype(np.float64)
        centre, (length, width, height), yaw = after.box[row, :3], after.box[row, 3:6], after.box[row, 6]
        assert length >= width
        c, s = np.cos(yaw), np.sin(yaw)
        along = (xyz - centre) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        assert (np.abs(along) <= np.array([length, width, height]) / 2 + 1e-5).all()
        np.testing.assert_allclose(np.ptp(along, axis=0), [length, width, height], atol=1e-5)  # and no larger
        np.testing.assert_allclose(after.centroid[row], xyz.mean(axis=0), atol=1e-5)
    yaw = after.box[scene.grouping.changed, 6] - scene.grouping.yaw
    np.testing.assert_allclose(np.sin(2 * yaw), 0, atol=1e-9)  # along the heading that was asked for, or across it


@given(scenes())
def test_what_did_not_change_keeps_its_columns(scene):
    before, source, n = scene.frame.proposals, scene.grouping.source, len(scene.grouping.source)
    after, observations = scene.grouping.apply(scene.frame, scene.placement)
    same = np.setdiff1d(np.arange(n), scene.grouping.changed)
    np.testing.assert_array_equal(after.box[same], before.box[source[same]])
    np.testing.assert_array_equal(after.centroid[same], before.centroid[source[same]])
    np.testing.assert_array_equal(after.cut, before.cut[source])
    np.testing.assert_array_equal(after.reflectance, before.reflectance[source])
    np.testing.assert_array_equal(after.ground_z_m, before.ground_z_m[source])
    for column in dataclasses.fields(observations):
        old, new = getattr(scene.frame.observations, column.name), getattr(observations, column.name)
        if column.name == "kdop":
            old, new = old.T, new.T
        if column.name != "sensor_xy":
            np.testing.assert_array_equal(new[same], old[source[same]], err_msg=column.name)


@given(scenes())
def test_observations_of_changed_proposals_are_deskewed_at_their_positions_and_others_kept(scene):
    after, observations = scene.grouping.apply(scene.frame, scene.placement)
    fresh = observe(after, scene.placement.T_world_sensor)
    step = scene.deskew[scene.grouping.source]
    step[scene.grouping.changed] = scene.placement.deskew(fresh.centroid[scene.grouping.changed])
    expected = fresh.moved(step)
    for column in dataclasses.fields(expected):
        found, want = getattr(observations, column.name), getattr(expected, column.name)
        np.testing.assert_allclose(found, want, atol=1e-6, err_msg=column.name)


@given(scenes())
def test_the_frame_before_is_left_as_it_was(scene):
    def columns():
        proposals, observations = scene.frame.proposals, scene.frame.observations
        return [proposals.box, proposals.centroid, observations.box, observations.kdop]

    before = [column.copy() for column in columns()]
    scene.grouping.apply(scene.frame, scene.placement)
    for was, column in zip(before, columns(), strict=True):
        np.testing.assert_array_equal(column, was)


@given(st.lists(st.integers(1, 5), min_size=1, max_size=7), st.data())
def test_runs_of_proposals_are_their_members_in_order_in_few_runs(counts, data):
    offsets, order = np.cumsum([0, *counts]), np.array(data.draw(st.permutations(range(len(counts)))), np.int64)
    runs = offsets.take(runs_of(order)).T.tolist()
    rows = [row for run in runs for row in range(*run)]
    assert rows == [row for k in order for row in range(*offsets[k : k + 2])]
    assert all(end != begin for (_, end), (begin, _) in itertools.pairwise(runs))


def test_corners_of_a_regrouped_box_enclose_both_parts():
    _, proposals = frame_of([box(10, 0, 2.0), box(13, 0, 2.0)])
    frame = Associated(proposals, observe(proposals, EYE), NO_MATCHES)
    zero = np.array([0])
    grouping = Grouping(np.array([[0], [120]]), np.array([120]), zero, zero, np.zeros(1))
    after, _ = grouping.apply(frame, Placement(EYE))
    np.testing.assert_allclose(corners(after.box)[0].min(axis=0), [9.0, -0.9], atol=1e-5)
    np.testing.assert_allclose(corners(after.box)[0].max(axis=0), [14.0, 0.9], atol=1e-5)
