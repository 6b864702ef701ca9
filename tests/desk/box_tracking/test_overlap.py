"""Overlap of boxes against polygons."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from shapely.geometry import Polygon

from modt.geometry import corners
from modt_desk.box_tracking.whole_tracks import birds_eye_intersection, iou_3d

BOXES = arrays(np.float64, (4, 7), elements=st.floats(0, 1)).map(
    lambda u: np.concatenate([6 * u[:, :3] - 3, 0.05 + 5 * u[:, 3:6], 8 * u[:, 6:] - 4], axis=1)
)


@given(BOXES, BOXES)
def test_intersection_area_matches_polygon_clipping(a, b):
    slow = [Polygon(p).intersection(Polygon(q)).area for p, q in zip(corners(a), corners(b), strict=True)]
    np.testing.assert_allclose(birds_eye_intersection(a, b), slow, atol=1e-6)


@given(BOXES)
def test_a_box_has_an_iou_of_one_with_itself(a):
    np.testing.assert_allclose(iou_3d(a, a), 1.0, atol=1e-6)


def test_iou_is_accurate_far_from_the_origin_and_zero_apart():
    a = np.array([[1e5, 1e5, 0, 4, 2, 1.5, 0.3]])
    b = a + np.array([1.0, 0.5, 0.5, 0, 0, 0, 0])
    far = np.array([1e5, 1e5, 0, 0, 0, 0, 0])
    near = iou_3d(a - far, b - far)
    np.testing.assert_allclose(iou_3d(a, b), near, atol=1e-6)
    assert iou_3d(a, a + np.array([9.0, 0, 0, 0, 0, 0, 0]))[0] == 0
    assert iou_3d(a, a + np.array([0, 0, 2.0, 0, 0, 0, 0]))[0] == 0
