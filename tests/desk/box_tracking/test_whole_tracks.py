import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from shapely.geometry import Polygon

from modt.geometry import corners
from modt_desk.box_tracking.sequences import (
    TrackedBoxes,
    birds_eye_intersection,
    bridged,
    iou_3d,
    of_one_class,
)


def tracked(rows):
    """Boxes of rows of frame, id, x, yaw and confidence."""
    frame, ids, x, yaw, confidence = (np.array(column) for column in zip(*rows, strict=True))
    box = np.tile([0, 0, -1, 4.0, 1.8, 1.5, 0], (len(rows), 1))
    box[:, 0], box[:, 6] = x, yaw
    return TrackedBoxes(frame, ids, np.repeat(x[:, None], 4, axis=1), box, confidence.astype(float))


def test_gaps_up_to_the_greatest_are_filled_on_the_line_between_their_ends():
    found = tracked([(0, 1, 0.0, 3.0, 4), (3, 1, 6.0, -3.0, 7), (8, 1, 9.0, -3.0, 7), (4, 2, 1.0, 0.0, 5)])
    filled = bridged(found, 3)
    assert list(zip(filled.frame, filled.id, strict=True)) == [(0, 1), (1, 1), (2, 1), (3, 1), (4, 2), (8, 1)]
    np.testing.assert_allclose(filled.box[:4, 0], [0, 2, 4, 6])
    np.testing.assert_allclose(filled.image_box[:4, 2], [0, 2, 4, 6])
    np.testing.assert_allclose(filled.confidence[:4], [4, 5, 6, 7])
    assert (np.cos(filled.box[:4, 6]) < -0.98).all()  # across pi, not through 0
    assert len(bridged(found, 4).frame) == len(filled.frame) + 4
    assert len(bridged(found, 0).frame) == len(found.frame)


def test_of_two_classes_on_one_object_the_more_confident_one_stays_unless_it_only_crosses():
    rows = [(i, number, x, 0, sure) for number, x, sure in ((1, 10, 4), (2, 10.5, 6), (4, 30, 3)) for i in range(4)]
    found = tracked(rows)
    assert set(of_one_class(found, found.id % 3).id) == {2, 4}
    assert set(of_one_class(found, np.zeros(len(rows))).id) == {1, 2, 4}
    crossing = tracked([(i, 1, 10 + 3 * i, 0, 4) for i in range(6)] + [(i, 2, 10, 0, 6) for i in range(6)])
    assert set(of_one_class(crossing, crossing.id).id) == {1, 2}


BOXES = arrays(np.float64, (4, 7), elements=st.floats(0, 1)).map(
    lambda u: np.concatenate([6 * u[:, :3] - 3, 0.05 + 5 * u[:, 3:6], 8 * u[:, 6:] - 4], axis=1)
)


@given(BOXES, BOXES)
def test_intersection_area_matches_polygon_clipping(a, b):
    slow = [Polygon(p).intersection(Polygon(q)).area for p, q in zip(corners(a), corners(b), strict=True)]
    np.testing.assert_allclose(birds_eye_intersection(a, b), slow, atol=1e-6)
    np.testing.assert_allclose(iou_3d(a, a), 1.0, atol=1e-6)


def test_iou_is_accurate_far_from_the_origin_and_zero_apart():
    a = np.array([[1e5, 1e5, 0, 4, 2, 1.5, 0.3]])
    b = a + np.array([1.0, 0.5, 0.5, 0, 0, 0, 0])
    far = np.array([1e5, 1e5, 0, 0, 0, 0, 0])
    near = iou_3d(a - far, b - far)
    np.testing.assert_allclose(iou_3d(a, b), near, atol=1e-6)
    assert iou_3d(a, a + np.array([9.0, 0, 0, 0, 0, 0, 0]))[0] == 0
    assert iou_3d(a, a + np.array([0, 0, 2.0, 0, 0, 0, 0]))[0] == 0
