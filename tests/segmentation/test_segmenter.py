import tracemalloc

import numpy as np
import pytest

from modt.config import SegmentationConfig, SensorConfig
from modt.geometry import FieldOfView
from modt.segmentation.segmenter import Segmenter
from modt.types import NONE, Cut
from tests.segmentation import reference, scans

CAR = (4.2, 1.8, 0.2, 1.8)
PERSON = (0.4, 0.5, 0.0, 1.75)
UP = np.deg2rad(np.linspace(-24, 20, 96))
AHEAD = FieldOfView(
    np.array([[np.sin(np.pi / 4), -np.cos(np.pi / 4), 0, 0], [np.sin(np.pi / 4), np.cos(np.pi / 4), 0, 0]])
)


def segmenter(fov=None, **sensor):
    return Segmenter(SegmentationConfig(), SensorConfig(**sensor), fov or FieldOfView())


def labels(points, **sensor):
    """(n,) proposal of each point."""
    return segmenter(**sensor).segment(points).label(len(points))


@pytest.mark.parametrize("n", [0, 1, 2, 5, 100])
def test_a_sweep_without_objects_gives_no_proposals(n):
    assert len(segmenter().segment(np.zeros((n, 4), np.float32))) == 0
    assert len(segmenter(AHEAD).segment(np.zeros((n, 4), np.float32))) == 0
    assert len(segmenter(height_m=None).segment(np.full((n, 4), 0.1, np.float32))) == 0


@pytest.mark.parametrize("fov", [None, AHEAD], ids=["all round", "ahead"])
def test_coordinates_and_centroids_of_the_members(fov):
    points, _ = scans.scan([(12.0, 3.0, *CAR), (-9.0, 4.0, *PERSON), (15.0, -4.0, *CAR)])
    proposals = segmenter(fov).segment(points)
    assert len(proposals) >= 2
    np.testing.assert_array_equal(proposals.coordinates, points[proposals.members, :3].T)
    means = [own.mean(axis=1) for own in np.split(proposals.coordinates, proposals.offsets[1:-1], axis=1)]
    np.testing.assert_allclose(proposals.centroid, means, atol=1e-4)
    assert not proposals.cut.any()


@pytest.mark.parametrize(
    ("height_m", "given_m", "slope", "atol"), [(0.8, 0.8, 0.0, 0.03), (0.8, None, 0.0, 0.03), (1.73, 1.73, 0.06, 0.1)]
)
def test_proposals_carry_the_ground_beneath_them(height_m, given_m, slope, atol):
    points, _ = scans.scan([(8.0 if height_m < 1 else 20.0, 0.0, *CAR)], height_m)
    points[:, 2] += slope * points[:, 0]
    proposals = segmenter(height_m=given_m).segment(points)
    assert len(proposals)
    assert proposals.ground_z_m == pytest.approx(slope * proposals.centroid[:, 0] - height_m, abs=atol)


def test_points_without_a_return_belong_to_no_proposal():
    points, _ = scans.scan([(12.0, 3.0, *CAR)])
    points[::7] = 0
    label = labels(points)
    assert (label[::7] == NONE).all()
    assert (label != NONE).any()


@pytest.mark.parametrize(
    ("boxes", "elevation", "least"),
    [
        # of a side along the ray, whose returns lie far apart, a piece may count as a person
        *(([(range_m, 0.3 * range_m, *CAR)], scans.HDL_64E, 0.8) for range_m in (20.0, 30.0, 40.0)),
        ([(12.0, 0.0, *CAR), (12.0, 0.5, 5.0, 4.0, 2.2, 5.0)], UP, 0.95),
    ],
    ids=["near", "farther", "far", "below an overhang"],
)
def test_a_car_is_one_proposal_without_anything_else(boxes, elevation, least):
    points, on = scans.scan(boxes, 1.73, elevation, step_deg=0.17, azimuth_deg=(-30, 40))
    label = labels(points)
    own = label[(on == 1) & (points[:, 2] > -1.73 + 0.3)]
    largest = np.bincount(own[own != NONE]).argmax()
    assert (own == largest).mean() > least
    assert set(on[label == largest]) == {1}


def test_cars_across_the_seams_of_directions_are_one_proposal_each():
    points, _ = scans.scan([(0.5, -12.0, *CAR), (-12.0, 0.5, *CAR)], step_deg=0.17)
    assert len(segmenter().segment(points)) == 2


def test_objects_that_reach_into_the_field_of_view_are_whole():
    boxes = [(10.0, 0.0, *CAR), (10.0, 10.5, *CAR), (-10.0, 0.0, *CAR), (20.0, -28.5, *CAR)]
    points, on = scans.scan(boxes, step_deg=0.25)
    proposals = segmenter(AHEAD).segment(points)
    held = {
        int(np.bincount(on[proposals.members[a:b]]).argmax())
        for a, b in zip(proposals.offsets, proposals.offsets[1:], strict=False)
    }
    assert held == {1, 2}
    label = proposals.label(len(points))
    assert (label[(on == 2) & (points[:, 2] > -1.4)] != NONE).mean() > 0.95


def test_an_object_cut_by_the_margin_is_truncated():
    points, _ = scans.scan([(16.0, 20.0, 3.0, 7.0, 0.0, 1.0)], step_deg=0.25)
    assert segmenter(AHEAD).segment(points).cut.tolist() == [Cut.SIDE]


def test_neither_the_order_of_the_points_nor_an_estimated_sensor_height_changes_the_proposals():
    points, _ = scans.scan([(12.0, 3.0, *CAR), (8.0, -4.0, *PERSON), (14.0, -8.0, 0.3, 20.0, 0.0, 2.5)], 0.9)
    order, straight = np.random.default_rng(2).permutation(len(points)), labels(points, height_m=0.9)
    assert reference.same_partition(labels(points[order], height_m=0.9), straight[order])
    assert (straight == labels(points, height_m=None)).mean() > 0.999


@pytest.mark.slow
def test_memory_of_a_dense_sweep_is_bounded():
    boxes = [(8.0 + 3 * i, (-1) ** i * (3.0 + i), *CAR) for i in range(8)] + [(0.0, 20.0, 90.0, 1.0, 0.0, 6.0)]
    points, _ = scans.scan(boxes, elevation=np.deg2rad(np.linspace(-24, 14, 128)), step_deg=0.176)
    assert len(points) > 150_000
    stage = segmenter()
    stage.segment(points)
    tracemalloc.start()
    stage.segment(points)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 60e6
