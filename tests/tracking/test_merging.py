"""A car that something nearer cuts in two stays one."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from modt.tracking.unions import Unions, united_proposals, united_sightings

from modt.classes import N_CLASSES, ObjectClass
from modt.config import TrackingConfig
from modt.geometry import boxes_about, corners, inverse, rotation_zyx, se3, transform_boxes, upright_box
from modt.geometry.kdop import DIRECTIONS
from modt.observations import observe
from modt.segmentation.reflectance_statistics import reflectance_statistics
from modt.tracking.states import EFFICIENT
from modt.types import NONE
from tests.tracking.tracking_scenes import Follower, box, frame_of

CAR = box(10, 3, 4.2, 1.8, 1.5)
REAR, FRONT = box(8.6, 3, 1.4, 1.8, 1.5), box(11.1, 3, 2.0, 1.8, 1.5)
KNOWN = 6
"""Frames in which the car is seen whole."""


def still(i):
    return np.eye(4)


def driving(i):
    """Far from the origin of the world, and turning."""
    return se3(rotation_zyx(0.01, -0.02, 0.7 + 0.02 * i), np.array([458_000.0 + 0.3 * i, 5_430_000.0, 120.0]))


def settle(tracker, *kinds, fixed=True):
    """Tell the tracks, in the order of their birth, what they are."""
    t = tracker.tracks
    t.final[:], t.key_points[:] = fixed, 50
    t.posterior[:] = t.key_posterior[:] = np.eye(N_CLASSES)[list(kinds)]


def seen(tracker, bodies, i, pose=still, points=80):
    """Follow a frame of bodies that stand where frame 0 has them; ids of whom the points of each belong to."""
    T = pose(i)
    frame, proposals = frame_of(transform_boxes(inverse(T) @ pose(0), np.array(bodies)), i, T, points=points)
    tracker.follow(frame, proposals)
    label = tracker.proposals.label(len(frame.points))
    assert NONE not in label
    row = tracker.tracks.row_of_proposal(len(tracker.proposals))
    return [tracker.tracks.id[row[own[0]]] for own in label.reshape(len(bodies), points)]


def known(bodies, kinds, pose=still, frames=KNOWN, association="kdop", fixed=True):
    """A tracker that knows these bodies."""
    tracker = Follower(TrackingConfig(association=association), EFFICIENT)
    for i in range(frames):
        seen(tracker, bodies, i, pose)
        settle(tracker, *kinds, fixed=fixed)
    return tracker


@pytest.mark.parametrize(
    ("kind", "length_m", "known_m"),
    [
        (ObjectClass.CAR, 5.8, 5.8),
        (ObjectClass.CAR, 6.4, 5.0),  # no car is as long
        (ObjectClass.BACKGROUND, 6.4, 6.4),
    ],
)
def test_what_a_car_is_one_with_is_not_what_was_seen_of_it(kind, length_m, known_m):
    tracker = known([box(10, 3, 5.0, 1.8, 1.5)], [kind])
    assert seen(tracker, [box(10, 3, length_m, 1.8, 1.5)], KNOWN) == [0]
    envelope = tracker.tracks.envelope[0]
    assert envelope[0] + envelope[4] == pytest.approx(known_m, abs=0.25)


@pytest.mark.parametrize("pose", [still, driving])
def test_a_car_in_two_pieces_is_one(pose):
    tracker = known([CAR], [ObjectClass.CAR], pose)
    for i in range(KNOWN, KNOWN + 8):
        assert seen(tracker, [REAR, FRONT], i, pose) == [0, 0]
        assert len(tracker.proposals) == 1
        settle(tracker, *[ObjectClass.CAR] * len(tracker.tracks))
    found = tracker.proposals
    np.testing.assert_allclose(found.box[0, 3:6], CAR[3:6], atol=0.05)
    assert found.occluded.tolist() == [True]
    np.testing.assert_allclose(tracker.tracks.box[0], transform_boxes(pose(0), np.array([CAR]))[0], atol=0.05)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"association": "paper"}, "the paper takes proposals as they are"),
        ({"kinds": [ObjectClass.BACKGROUND]}, "it is no car"),
        ({"fixed": False}, "it may be none"),
        ({"frames": 3}, "it is not known for long enough"),
    ],
)
def test_only_cars_that_are_known_are_made_whole(change, why):
    tracker = known(**({"bodies": [CAR], "kinds": [ObjectClass.CAR]} | change))
    seen(tracker, [REAR, FRONT], KNOWN)
    assert len(tracker.proposals) == 2, why


@pytest.mark.parametrize(
    ("own", "piece", "why"),
    [
        (REAR, box(13.0, 3, 1.5, 1.8, 1.5), "it lies ahead of the car"),
        (REAR, box(11.1, 4.2, 2.0, 1.8, 1.5), "it reaches beyond its side"),
        (
            FRONT,
            box(13.0, 3, 2.0, 1.8, 1.5),
            "most of it lies ahead, though both are no longer than the car",
        ),
        (REAR, box(11.65, 3, 2.1, 1.8, 1.5), "both are longer than the car, though most of it lies within"),
    ],
)
def test_what_the_car_never_was_is_no_part_of_it(own, piece, why):
    tracker = known([CAR], [ObjectClass.CAR])
    seen(tracker, [own, piece], KNOWN)
    assert len(tracker.proposals) == 2, why


@pytest.mark.parametrize(("kind", "alone"), [(ObjectClass.PEDESTRIAN, True), (ObjectClass.BACKGROUND, False)])
def test_who_is_known_as_a_person_stays_one(kind, alone):
    kinds = [ObjectClass.CAR, kind]
    tracker = known([CAR, box(12.7, 3, 0.5, 0.5, 1.7)], kinds)
    for i, x in enumerate((12.5, 12.3, 12.1)):
        seen(tracker, [CAR, box(x, 3, 0.5, 0.5, 1.7)], KNOWN + i)
        settle(tracker, *kinds)
    owners = seen(tracker, [REAR, box(11.9, 3, 0.5, 0.5, 1.7)], KNOWN + 3)
    assert (owners == [0, 1]) == alone


def test_a_car_takes_all_its_pieces():
    lorry = box(10, 3, 9.0, 1.8, 1.5)
    tracker = known([lorry], [ObjectClass.CAR])
    pieces = [box(7.0, 3, 2.0, 1.8, 1.5), box(9.4, 3, 2.0, 1.8, 1.5), box(12.5, 3, 3.0, 1.8, 1.5)]
    assert seen(tracker, pieces, KNOWN) == [0, 0, 0]
    assert len(tracker.proposals) == 1


YOUNGER = box(15, 3, 4.2, 1.8, 1.5)


def two_cars(ahead_m=0.0, behind_m=0.0):
    """A tracker that knows CAR, who was once taken for longer ahead, and YOUNGER, once taken for longer behind."""
    tracker = known([CAR, YOUNGER], [ObjectClass.CAR, ObjectClass.CAR])
    tracker.tracks.envelope[0] += np.maximum(DIRECTIONS[0], 0) * ahead_m
    tracker.tracks.envelope[1] += np.maximum(-DIRECTIONS[0], 0) * behind_m
    return tracker


def test_an_elder_car_keeps_its_own():
    tracker = two_cars(behind_m=3.5)
    assert seen(tracker, [FRONT, YOUNGER], KNOWN) == [0, 1]


def test_what_may_be_a_piece_of_two_cars_is_the_elders():
    tracker = two_cars(ahead_m=3.5, behind_m=3.5)
    assert seen(tracker, [CAR, YOUNGER, box(12.5, 3, 0.5, 1.8, 1.5)], KNOWN) == [0, 1, 0]


def test_a_car_that_takes_something_gives_nothing_away():
    tracker = two_cars(ahead_m=3.5)
    near, far = box(14.2, 3, 2.6, 1.8, 1.5), box(16.4, 3, 1.3, 1.8, 1.5)
    assert seen(tracker, [CAR, near, far], KNOWN) == [0, 1, 1]
    assert len(tracker.proposals) == 2


def groups(draw, n):
    """Hosts and parts among n proposals."""
    role = draw(st.lists(st.integers(-1, n - 1), min_size=n, max_size=n))
    hosts = {k for k in range(n) if role[k] < 0}
    pairs = [(h, k) for k, h in enumerate(role) if h in hosts]
    return np.array([h for h, _ in pairs], np.int64), np.array([k for _, k in pairs], np.int64)


@given(st.lists(st.integers(6, 14), min_size=2, max_size=7), st.floats(-3, 3), st.data())
def test_unions_hold_what_their_parts_did(counts, yaw, data):
    n = len(counts)
    frame, proposals = frame_of([box(6 * k + 5, k, yaw=0.3 * k) for k in range(n)], points=counts)
    light = np.random.default_rng(n).uniform(0, 1, len(frame.points)).astype(np.float32)
    told = reflectance_statistics(light[proposals.members], proposals.offsets)
    proposals = dataclasses.replace(proposals, reflectance=told, truncated=np.arange(n) % 3 == 0, sensor_height_m=1.6)
    hosts, parts = groups(data.draw, n)
    if not len(parts):
        return
    unions = Unions.of(n, hosts, parts)
    after = united_proposals(proposals, unions, np.full(len(np.unique(hosts)), yaw))
    assert sorted(after.members) == sorted(proposals.members)
    assert after.coordinates.shape == (3, 0)
    assert after.sensor_height_m == 1.6
    into = np.arange(n)
    into[parts] = hosts
    kept = np.unique(into)
    assert unions.kept.tolist() == kept.tolist()
    assert unions.hosts.tolist() == np.unique(hosts).tolist()
    label, before = after.label(len(frame.points)), into[proposals.label(len(frame.points))]
    np.testing.assert_array_equal(kept[label], before)
    own = [frame.points[label == k, :3].astype(np.float64) for k in range(len(kept))]
    np.testing.assert_allclose(after.centroid, [p.mean(axis=0) for p in own], atol=1e-5)
    expected = reflectance_statistics(light[after.members], after.offsets)
    np.testing.assert_allclose(after.reflectance, expected, atol=1e-5)
    for k in unions.new:
        exact = upright_box(own[k].T, float(after.box[k, 6]))
        assert (after.box[k, 3:6] >= exact[3:6] - 1e-6).all()
        assert after.occluded[k]
        assert after.truncated[k] == proposals.truncated[into == kept[k]].any()
    others = np.setdiff1d(np.arange(len(kept)), unions.new)
    np.testing.assert_array_equal(after.box[others], proposals.box[kept[others]])

    T = driving(3)
    seen = dataclasses.replace(after, coordinates=frame.points[after.members, :3].T)
    fresh, said = observe(seen, T), united_sightings(observe(proposals, T), unions, after, T)
    for column in dataclasses.fields(fresh):
        if column.name != "cut":
            np.testing.assert_allclose(
                getattr(said, column.name), getattr(fresh, column.name), atol=1e-4, err_msg=column.name
            )
    assert said.partial[unions.new].all()


def test_nothing_is_known_of_the_brightness_of_a_union_with_what_has_none():
    _, proposals = frame_of([box(5, 0), box(9, 0)])
    told = np.full((2, 5), 0.5)
    told[1] = np.nan
    unions = Unions.of(2, np.array([0]), np.array([1]))
    after = united_proposals(dataclasses.replace(proposals, reflectance=told), unions, np.zeros(1))
    assert np.isnan(after.reflectance).all()
    assert united_proposals(proposals, unions, np.zeros(1)).reflectance is None


@given(st.lists(st.tuples(*[st.floats(-9, 9)] * 3, st.floats(-4, 4)), min_size=1, max_size=4), st.floats(-4, 4))
def test_a_box_about_boxes_is_the_least_at_its_heading(places, yaw):
    boxes = np.array([[x, y, z, 3.0, 1.0, 1.2, turn] for x, y, z, turn in places])
    (about,) = boxes_about(boxes, np.zeros(len(boxes), np.int64), np.array([yaw]))
    ends = np.concatenate([np.c_[corners(boxes).reshape(-1, 2), np.repeat(boxes[:, 2] + s, 4)] for s in (-0.6, 0.6)])
    expected = upright_box(ends.T, yaw)
    np.testing.assert_allclose(about[:6], expected[:6], atol=1e-9)
    np.testing.assert_allclose(np.sin(about[6] - expected[6]) * (expected[3] - expected[4] > 1e-6), 0, atol=1e-9)
