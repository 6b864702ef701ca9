import numpy as np
import pytest

from modt import profile
from modt.config import SegmentationConfig
from modt.geometry import FieldOfView
from modt.segmentation.gaps import gaps_of, unseen_m
from modt.segmentation.grids import PointColumns
from modt.segmentation.segmenter import Segmenter
from modt.types import PointKind
from tests.segmentation import scans

SENSOR = profile.load("vlp-16").sensor
ELEVATIONS = SENSOR.beam_elevations_deg
MOUNT_M = 0.8
CAR = (1.8, 4.2, 0.2, 1.4)


def degrees(gaps):
    return np.rad2deg(np.arctan(gaps))


def without_beam(dead_deg, x):
    """A sweep of a car without a beam, and which of its points are on the car."""
    points, on = scans.scan([(x, 0.0, *CAR)], MOUNT_M, scans.VLP_16, step_deg=0.2)
    alive = np.abs(scans.elevation_deg(points) - dead_deg) > 0.5
    return points[alive], on[alive] == 1


def segmented(points, dead_deg):
    segmenter = Segmenter(SegmentationConfig(), SENSOR, FieldOfView())
    segmenter.leave_out(dead_deg)
    return segmenter.segment(points)


def test_a_gap_reaches_from_the_beam_below_to_the_one_above():
    assert degrees(gaps_of(ELEVATIONS, (1.0,)))[0] == pytest.approx([-2.0, 1.0, 1.0, 4.0], abs=0.01)


def test_dead_beams_side_by_side_leave_one_gap_and_outermost_ones_none():
    gaps = degrees(gaps_of(ELEVATIONS, (15.0, 3.0, 1.0, -13.0, -15.0)))
    assert gaps == pytest.approx(np.array([[-2.0, 1.0, 3.0, 6.0]]), abs=0.01)
    assert degrees(gaps_of(ELEVATIONS, (13.0, -13.0)))[[0, 1], [0, 3]] == pytest.approx([-15.0, 15.0])


def test_what_is_next_to_a_gap_may_fill_it():
    z = 10 * np.tan(np.deg2rad([-3.0, -1.0, 3.0, 5.0]))
    points = PointColumns.from_array(np.stack([np.full(4, 10.0), np.zeros(4), z], axis=1).astype(np.float32))
    step_m = z[1] - z[0]
    expected = [0.0, step_m, step_m, 0.0]
    assert unseen_m(gaps_of(ELEVATIONS, (1.0,)), points) == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize("range_m", [17.5, 19.0, 21.0])
def test_a_car_below_a_dead_beam_is_no_ground(range_m):
    points, on_car = without_beam(1.0, range_m)
    kind = segmented(points, (1.0,)).kind
    seen = on_car & (points[:, 2] > 0.35 - MOUNT_M)
    assert (kind[seen] == PointKind.MEMBER).all()


def test_beams_that_return_are_taken_for_alive_again():
    points, _ = without_beam(1.0, 19.0)
    segmenter = Segmenter(SegmentationConfig(), SENSOR, FieldOfView())
    before = segmenter.segment(points).kind.copy()
    segmenter.leave_out((1.0,))
    assert (segmenter.segment(points).kind != before).any()
    segmenter.leave_out(())
    np.testing.assert_array_equal(segmenter.segment(points).kind, before)
