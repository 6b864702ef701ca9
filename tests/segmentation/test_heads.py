"""People within a cluster that is more than one object."""

import numpy as np
import pytest

from modt.segmentation.heads import find_people
from modt.segmentation.tuning import SegmentationTuning
from modt.types import NONE

TUNING = SegmentationTuning().heads
CELL_M = 0.06


def column(x, y, width_m, depth_m, bottom_m, top_m, points=6):
    """Cells (k, 5) of an upright box: x, y, low, high and number of points."""
    xs, ys = (np.arange(-size / 2, size / 2 + 1e-9, CELL_M) for size in (width_m, depth_m))
    at = np.array([(x + dx, y + dy) for dx in xs for dy in ys])
    rest = np.broadcast_to((bottom_m, top_m, points), (len(at), 3))
    return np.concatenate([at, rest], axis=1)


def person(x, y, height_m=1.75):
    """Cells of somebody who stands: shoulders, and a head on them."""
    body = column(x, y, 0.24, 0.48, 0.3, height_m - 0.33)
    head = column(x, y, 0.18, 0.18, 0.3, height_m)
    return np.concatenate([body[np.hypot(*(body[:, :2] - (x, y)).T) > 0.1], head])


def arguments(*parts):
    """Arguments of `find_people` for one cluster of these parts."""
    x, y, low, high, points = np.concatenate(parts).T
    return *(v.astype(np.float32) for v in (x, y, low, high)), points.astype(np.int64), TUNING


def people(*parts):
    """Number of the person of most cells of each part, NONE where it is nobody's."""
    owner = find_people(*arguments(*parts))
    of_part = np.split(owner, np.cumsum([len(part) for part in parts])[:-1])
    return [int(np.bincount(part + 1).argmax()) - 1 for part in of_part]


TROLLEY = column(6.0, 0.0, 1.0, 0.6, 0.3, 1.1)
BICYCLE = [column(5.0 + side * 0.75, 0.0, 0.5, 0.06, 0.3, 0.68) for side in (-1, 1)]


@pytest.mark.parametrize("gap_m", [0.0, 0.15])
@pytest.mark.parametrize("heights_m", [(1.75, 1.75), (1.8, 1.7)])
def test_a_pair_is_two_people(gap_m, heights_m):
    assert sorted(people(person(5, 0, heights_m[0]), person(5, 0.48 + gap_m, heights_m[1]))) == [0, 1]


def test_three_abreast_are_three_people():
    assert sorted(people(*(person(5, 0.53 * k) for k in range(3)))) == [0, 1, 2]


@pytest.mark.parametrize("gap_m", [0.06, 0.12])
@pytest.mark.parametrize(("top_m", "found"), [(2.5, [0, NONE]), (1.9, [NONE, NONE])])
def test_who_stands_at_a_column_is_a_person_and_the_column_is_not(gap_m, top_m, found):
    """A thing no higher than a person divides nothing: it may be a part of the person, such as a raised load."""
    assert people(person(5, 0), column(5, 0.24 + gap_m + 0.3, 0.6, 0.6, 0.0, top_m)) == found


def test_who_pushes_a_trolley_is_a_person_and_the_trolley_is_not():
    assert people(person(5.1, 0), TROLLEY) == [0, NONE]


def test_a_post_of_a_stall_leaves_without_the_goods_around_it():
    post = column(5, 1.3, 0.06, 0.06, 0.3, 1.9, points=12)
    goods = column(5, 1.6, 0.3, 0.36, 0.3, 1.0)
    assert people(person(5, 0), column(5, 0.8, 0.6, 0.6, 0.3, 0.9), post, goods) == [1, NONE, 0, NONE]


@pytest.mark.parametrize(
    "parts",
    [
        [person(5, 0)],
        [TROLLEY],
        [person(5, 0), *BICYCLE],
        [person(5, 0), BICYCLE[1]],
        [column(5, 0, 0.5, 1.8, 0.3, 1.5)],
        [column(5, 0, 0.5, 1.8, 0.3, 1.45), column(5, 0.6, 0.18, 0.18, 0.3, 1.5)],
        [person(5, 0), column(5, 0.8, 0.06, 0.06, 0.3, 1.0, points=1)],
    ],
    ids=["person", "trolley", "rider", "half a rider", "car", "roof", "post"],
)
def test_what_is_one_object_holds_no_people(parts):
    assert set(people(*parts)) == {NONE}
