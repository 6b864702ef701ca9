"""Long surfaces, and what stands before them."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from modt.config import SegmentationConfig, SensorConfig
from modt.segmentation.clustering import Clusterer
from modt.segmentation.grids import PointColumns
from modt.segmentation.kernels import NUMPY
from modt.segmentation.structure import find_surfaces
from modt.segmentation.tuning import SegmentationTuning
from modt.types import NONE, PointKind

TUNING = SegmentationTuning().structure
SENSOR = SensorConfig(max_range_m=60.0, azimuth_step_deg=0.2)


def wall(x0, x1, y, height=2.5):
    """Points of a wall along x."""
    return grid(np.arange(x0, x1, 0.01), y, height)


def grid(x, y, height):
    """Points above those of a line, each 0.1 m."""
    z = np.arange(0.3, height, 0.2)
    x, z = np.meshgrid(x, z)
    return np.stack([x.ravel(), np.full(x.size, y), z.ravel()], axis=1)


def person(x, y):
    """Points of an upright cylinder, half of which is seen."""
    angle = np.linspace(-np.pi, 0, 16)
    ring = np.stack([x + 0.25 * np.cos(angle), y + 0.2 * np.sin(angle)], axis=1)
    return np.concatenate([np.column_stack([ring, np.full(len(ring), z)]) for z in np.arange(0.3, 1.7, 0.1)])


def clustered(points):
    """Clusters of points whose heights above ground are their z."""
    columns = PointColumns.from_array(points.astype(np.float32))
    clusterer = Clusterer(SENSOR, SegmentationConfig(), NUMPY)
    return clusterer.cluster(clusterer.occupied_cells(columns, columns.z))


def label(clusters):
    """(K,) cluster of each point."""
    return clusters.cluster_of_cell[clusters.cell_of_point]


@pytest.mark.parametrize("angle", np.linspace(0, np.pi, 7))
def test_a_wall_is_found_at_every_angle(angle):
    t = np.arange(-4, 4, 0.1)
    x, y = t, np.full_like(t, 3.0)
    x, y = x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle)
    on_surface, before_m = find_surfaces(x, y, np.full_like(x, 0.1), TUNING)
    assert on_surface.all()
    assert np.abs(before_m).max() < 1e-9


def test_what_is_nearer_to_the_sensor_is_before_a_surface():
    x = np.append(np.arange(-4, 4, 0.1), [0.0, 0.0, 9.0])
    y = np.append(np.full(80, 3.0), [2.4, 3.5, 3.0])
    on_surface, before_m = find_surfaces(x, y, np.full_like(x, 0.1), TUNING)
    assert on_surface.tolist() == [True] * 80 + [False] * 3
    assert_allclose(before_m[80:], [0.6, -0.5, np.inf], atol=1e-6)


def test_few_cells_have_no_surface():
    on_surface, before_m = find_surfaces(np.arange(5.0), np.ones(5), np.full(5, 0.1), TUNING)
    assert not on_surface.any()
    assert np.isinf(before_m).all()


@pytest.mark.parametrize("gap_m", [0.05, 0.2, 0.5])
def test_a_person_at_a_wall_is_a_proposal_and_an_endless_wall_is_structure(gap_m):
    first = wall(-12, 12, 4.0)
    clusters = clustered(np.concatenate([first, person(1.0, 4.0 - gap_m - 0.25)]))
    of_wall, of_person = np.split(label(clusters), [len(first)])
    assert clusters.n == 1
    assert (of_person == 0).mean() > 0.9
    assert (of_wall == NONE).mean() > 0.9
    kind = clusters.kind_of_cell[clusters.cell_of_point[: len(first)]]
    assert (kind == PointKind.STRUCTURE).mean() > 0.9


def test_a_long_vehicle_is_one_proposal():
    side = wall(-6, 6, 6.0)
    assert set(label(clustered(side))) == {0}


def test_a_person_in_a_doorway_is_a_proposal():
    jambs = np.concatenate([wall(-3.0, -0.5, 5.0), wall(0.5, 3.0, 5.0)])
    clusters = clustered(np.concatenate([jambs, person(0.0, 5.1)]))
    of_person = label(clusters)[len(jambs) :]
    assert np.unique(of_person).tolist() == [of_person[0]]
    assert not np.isin(of_person[0], label(clusters)[: len(jambs)])


@pytest.mark.parametrize(("wall_m", "leaves"), [(1.0, True), (1.6, False)])
def test_head_and_shoulders_above_a_wall_are_a_proposal_and_what_is_as_high_as_the_wall_is_not(wall_m, leaves):
    before = wall(-2, 2, 6.0, wall_m)
    behind = person(0.3, 6.4)
    seen = behind[(behind[:, 2] > 1.25) & (behind[:, 2] < 1.65)]
    of_wall, of_person = np.split(label(clustered(np.concatenate([before, seen]))), [len(before)])
    assert np.isin(of_person, of_wall).any() != leaves


def test_a_beam_above_does_not_join_people():
    beam = np.concatenate([grid(np.arange(-6, 6, 0.05), y, 2.2) for y in (3.9, 4.0, 4.1)])
    beam = beam[beam[:, 2] > 1.7]
    clusters = clustered(np.concatenate([beam, person(-2.0, 4.0), person(2.0, 4.0)]))
    people = label(clusters)[len(beam) :]
    one, other = people.reshape(2, -1)
    assert set(one).isdisjoint(other)
    assert NONE not in people


@pytest.mark.parametrize("seed", range(3))
def test_a_person_whose_hand_touches_a_wall_needs_its_surface_to_be_found(seed):
    across = np.arange(3.5, 4.0, 0.02)
    hand = np.concatenate(
        [np.column_stack([np.full(25, 1.0 + off), across, np.ones(25)]) for off in (0.0, 0.05, 0.1)]
    )
    of_wall = wall(-12, 12, 4.0)
    points = np.concatenate([of_wall, person(1.0, 3.65), hand])
    points[:, 1] += np.random.default_rng(seed).normal(0, 0.02, len(points))
    columns = PointColumns.from_array(points.astype(np.float32))
    tuning = SegmentationTuning()
    without = replace(tuning, structure=replace(tuning.structure, max_lines=0))
    parted = []
    for each in (tuning, without):
        clusterer = Clusterer(SENSOR, SegmentationConfig(), NUMPY, each)
        clusters = clusterer.cluster(clusterer.occupied_cells(columns, columns.z))
        on_wall, on_person = np.split(label(clusters) != NONE, [len(of_wall)])
        parted.append(on_person.mean() > 0.5 and on_wall.mean() < 0.2)
    assert parted == [True, False]
