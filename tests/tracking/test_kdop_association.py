import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from modt.tracking.background_map import BackgroundMap, NoBackgroundMap

from modt.classes import ObjectClass
from modt.config import TrackingConfig
from modt.geometry import corners
from modt.geometry.kdop import AXES, DIRECTIONS
from modt.geometry.kdop_displacement import AGREE_M
from modt.tracking.fragments import _fits
from modt.tracking.kdop_association import SOFT_M, compare
from modt.tracking.states import EFFICIENT
from modt.types import NONE
from tests.tracking.tracking_scenes import Follower, box, frame_of

EYE = np.eye(4)
BACKGROUND, CAR = np.eye(4)[ObjectClass.BACKGROUND], np.eye(4)[ObjectClass.CAR]


def tracker(regroupings=None, **options):
    return Follower(TrackingConfig(ask_from=1, **options), EFFICIENT, regroupings=regroupings)


def classify(tracker, posterior):
    """Settle whatever asks."""
    rows = np.flatnonzero(tracker.wants_class)
    tracker.tracks.posterior[rows], tracker.tracks.final[rows] = posterior, True
    tracker.conclude(rows, np.ones(len(rows), np.bool_))
    return len(rows)


def run(tracker, scenes, posterior=BACKGROUND, first=0, **options):
    asked = 0
    for i, boxes in enumerate(scenes, first):
        tracker.follow(*frame_of(boxes, i, EYE, **options))
        asked += classify(tracker, posterior)
    return asked


def kdop(centre, half):
    return (np.asarray(centre) @ DIRECTIONS + half)[:, None]


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(0.2, 3))
def test_what_keeps_its_shape_shifts_as_it_moved(dx, dy, half):
    shift, size, overlap, _ = compare(kdop((0, 0), half), kdop((dx, dy), half))
    np.testing.assert_allclose(shift, [[dx, dy]], atol=1e-9)
    np.testing.assert_allclose(size, 0, atol=1e-9)
    assert 0 <= overlap[0] <= 1


def slow_compare(low_a, high_a, low_b, high_b):
    """Shift, size, overlap and cover of one pair of outlines, number by number."""
    shifts, sizes, squares = [], [], ([], [], [])
    longest = max(*(high_a - low_a), *(high_b - low_b), 1.0)
    for la, ha, lb, hb in zip(low_a, high_a, low_b, high_b, strict=True):
        ahead, behind = hb - ha, lb - la
        smaller = ahead if abs(ahead) < abs(behind) else behind
        alike = max(0.0, 1 - ((ahead - behind) * longest / AGREE_M) ** 2) ** 2
        shifts.append(alike * (ahead + behind) / 2 + (1 - alike) * smaller)
        sizes.append(abs(np.log(hb - lb + SOFT_M) - np.log(ha - la + SOFT_M)))
        common = max(min(ha, hb) - max(la, lb) + SOFT_M / 3, 0.0)
        for side, length in zip(squares, (ha - la + SOFT_M / 3, hb - lb + SOFT_M / 3, common), strict=True):
            side.append(length)
    shift = [sum(s * c for s, c in zip(shifts, axis, strict=True)) / 2 for axis in AXES]
    a, b, common = ([s[0] * s[2], s[1] * s[3]] for s in squares)
    overlap = min(c / (p + q - c) for p, q, c in zip(a, b, common, strict=True))
    cover = min(c / min(p, q) for p, q, c in zip(a, b, common, strict=True))
    return shift, sum(sizes) / 4, overlap, cover


@given(st.integers(0, 6), st.integers(0, 2**16))
def test_compare_is_the_slow_one_row_by_row(n, seed):
    rng = np.random.default_rng(seed)
    middle, length = rng.uniform(-2, 2, (2, n, 4)), rng.uniform(0.0, 3.0, (2, n, 4))
    middle[1, ::2] = middle[0, ::2] + rng.normal(0, 0.1, middle[0, ::2].shape)  # some pairs are nearly alike
    length[1, ::2] = np.abs(length[0, ::2] + rng.normal(0, 0.1, length[0, ::2].shape))
    ends = (middle[0] - length[0], middle[0] + length[0], middle[1] - length[1], middle[1] + length[1])
    a, b = np.split(np.concatenate([ends[1], -ends[0], ends[3], -ends[2]], axis=1).T, 2)
    found = compare(a, b)
    for k in range(n):
        for fast, slow in zip(found, slow_compare(*(e[k] for e in ends)), strict=True):
            np.testing.assert_allclose(fast[k], slow, atol=1e-9)


def test_what_only_grows_does_not_shift():
    before = kdop((0, 0), 1.0)
    for growth in ([2.0, 1.5, 0, 0, 0, 0, 0, 0], [0, 1.0, 2.0, 1.0, 0, 0, 0, 0]):
        shift, _, _, cover = compare(before, before + np.array(growth)[:, None])
        np.testing.assert_allclose(shift, 0, atol=1e-9)
        assert cover[0] > 0.9


def test_a_standing_car_that_comes_into_view_has_no_speed():
    """Its rear stays where it is; its centre runs ahead."""
    t = tracker()
    run(t, [[box(10 + 0.1 * i, 3, l=1.0 + 0.2 * i)] for i in range(15)], CAR)
    assert list(t.tracks.id) == [0]
    assert t.tracks.x[0, 3] < 0.5  # its front comes into view at 2 m/s


def slow_fits(a, b, room):
    """Whether the corners of two boxes lie in the room, along the heading of the longer one."""
    yaw = a[6] if a[3] > b[3] else b[6]
    points = np.concatenate([corners(a[None])[0], corners(b[None])[0]])
    c, s = np.cos(yaw), np.sin(yaw)
    along, across = np.ptp(points @ [c, s]), np.ptp(points @ [-s, c])
    return max(along, across) < room[0] and min(along, across) < room[1]


@given(st.integers(0, 2**16))
def test_parts_fit_where_their_corners_do(seed):
    rng = np.random.default_rng(seed)
    a, b = rng.uniform([-2, -2, 0, 0.2, 0.2, 1, -4], [2, 2, 0, 4, 2, 1, 4], (2, 50, 7))
    room = rng.uniform([1.0, 0.5], [7.0, 4.0], (50, 2))
    assert _fits(a, b, room).tolist() == [slow_fits(*k) for k in zip(a, b, room, strict=True)]


def test_a_car_behind_a_pole_stays_one_object():
    whole, halves = [box(12, 4)], [box(11.0, 4, l=1.9), box(13.3, 4, l=1.3)]
    t = tracker(regroupings=())
    run(t, [whole] * 4, CAR)
    run(t, [halves, halves[::-1], halves], CAR, first=4, points=(80, 40))
    for_the_larger = t.tracks.id[t.tracks.proposal == 0]
    assert list(for_the_larger) == [0]
    swap_proposals = [box(11.0, 4, l=1.2), box(13.0, 4, l=1.9)]
    run(t, [swap_proposals, swap_proposals], CAR, first=7, points=(40, 80))
    assert list(t.tracks.id[t.tracks.proposal == 1]) == [0]
    run(t, [whole], CAR, first=9)
    assert list(t.tracks.id[t.tracks.proposal == 0]) == [0]


def test_two_cars_in_a_row_stay_two():
    t = tracker()
    row = [box(10, 4), box(15.2, 4)]
    for points in ((80, 40), (40, 80), (80, 40)):
        run(t, [row] * 3, CAR, first=t.tracks.age.max(initial=0), points=points)
        assert list(t.tracks.id[np.argsort(t.tracks.proposal)]) == [0, 1]


def test_an_object_waits_while_a_wall_swallows_it():
    t = tracker()
    person, wall = box(10, 2, 0.6, 0.6, 1.7), box(10, 3.5, 12, 0.4, 2.5)
    run(t, [[person]] * 4, np.eye(4)[ObjectClass.PEDESTRIAN])
    run(t, [[box(10, 2.9, 12, 1.9, 2.5)]] * 2, first=4)
    assert t.tracks.proposal[t.tracks.id == 0] == NONE
    run(t, [[person, wall]], first=6)
    assert t.tracks.id[t.tracks.proposal == 0] == 0


def test_a_lost_track_is_found_along_its_prediction():
    t = tracker()
    moving = [[box(10 + 0.8 * i, 0)] if i not in (8, 9, 10) else [] for i in range(13)]
    run(t, moving, CAR)
    assert list(t.tracks.id) == [0]
    assert t.tracks.missed[0] == 0


def far(i):
    return box(30, -8 - 0.01 * i, 1, 1)


def test_background_is_remembered_where_it_stood():
    for background_map, asked in ((BackgroundMap(), 0), (NoBackgroundMap(), 1)):
        t = Follower(TrackingConfig(ask_from=1, max_missed=2), EFFICIENT, background_map=background_map)
        run(t, [[far(0), box(10, 4, 1, 1)]] * 4)
        run(t, [[far(0)]] * 5, first=4)
        assert len(t.tracks) == 1
        assert run(t, [[far(0), box(10.05, 4, 1, 1)]], first=9) == asked
        back = t.tracks.id == 2
        assert t.machine.names[t.tracks.state[back][0]] == "tracked"
        assert t.tracks.posterior[back][0].argmax() == ObjectClass.BACKGROUND


@pytest.mark.parametrize("stranger", [box(10, 4, 1, 1, h=2.6, z=-0.45), box(12, 4, 1, 1), box(10, 4, 3, 3)])
def test_what_is_taller_larger_or_elsewhere_asks(stranger):
    t = tracker(max_missed=2)
    run(t, [[far(0), box(10, 4, 1, 1)]] * 4)
    run(t, [[far(0)]] * 5, first=4)
    assert run(t, [[far(0), stranger]], first=9) == 1


def test_foreground_is_not_remembered():
    t = tracker(max_missed=2)
    run(t, [[far(0), box(10, 4, 1, 1)]] * 4, CAR)
    run(t, [[far(0)]] * 5, CAR, first=4)
    assert run(t, [[far(0), box(10, 4, 1, 1)]], first=9) == 1


def test_what_leaves_its_place_must_ask_after_all():
    """A pedestrian who parts from the wall that it stood before is background until it has gone a step."""
    t = tracker()
    run(t, [[box(10, 3, 12, 2.0, 1.8)]] * 4)
    steps = [[box(10, 3.6, 12, 0.8, 1.8), box(10, 2.8 - 0.15 * i, 0.5, 0.5, 1.7)] for i in range(8)]
    assert run(t, steps[:2], first=4) == 0
    assert run(t, steps[2:], first=6) == 1


def test_what_a_view_said_since_holds_away_from_the_place_too():
    t = tracker()
    run(t, [[box(10, 3, 12, 2.0, 1.8)]] * 4)
    steps = [[box(10, 3.6, 12, 0.8, 1.8), box(10, 2.8 - 0.15 * i, 0.5, 0.5, 1.7)] for i in range(8)]
    run(t, steps[:2], first=4)
    parted = t.tracks.id.argmax()
    assert t.tracks.inherited[parted]
    t.tracks.key_points[parted] = 40  # as fusion notes it, where mode accurate looks again
    assert run(t, steps[2:], first=6) == 0
    assert not t.tracks.inherited[t.tracks.id.argmax()]
    assert t.tracks.final[t.tracks.id.argmax()]


def test_memory_forgets_the_oldest():
    background_map = BackgroundMap(capacity=3)
    t = Follower(TrackingConfig(ask_from=1, max_missed=0), EFFICIENT, background_map=background_map)
    for i in range(5):
        run(t, [[box(10 + 5 * i, 0, 1, 1)]] * 2, first=2 * i)
    assert len(background_map) == 3
    assert run(t, [[box(10, 0, 1, 1)]], first=10) == 1
    assert run(t, [[box(20, 0, 1, 1)]], first=11) == 0
