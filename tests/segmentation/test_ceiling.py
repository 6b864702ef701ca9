"""The ceiling of a room is no object and joins none."""

from dataclasses import replace

import numpy as np
import pytest

from modt.config import SegmentationConfig
from modt.geometry import FieldOfView
from modt.profile import load
from modt.segmentation.ceiling import CeilingFinder
from modt.segmentation.grids import SECTORS
from modt.segmentation.ground import GroundEstimator
from modt.segmentation.segmenter import Segmenter
from modt.types import PointKind
from modt_simulation.synthetic_stream import SyntheticStream
from tests.segmentation import scans

RNG = np.random.default_rng(0)
GROUND = GroundEstimator(load("vlp-16").sensor, 16.0)
CEILING = CeilingFinder(GROUND, 2.6)
RINGS = GROUND.grid.rings


def tops(height_m):
    """(RINGS, SECTORS) tops of cells [m], by their (SECTORS, rings) heights; NaN where there is no return."""
    return np.where(np.isnan(height_m), -np.inf, height_m).astype(np.float32).T


def seen_from(first, last, height_m):
    """Heights in every other ring of a range of rings, as beams meet a ceiling."""
    height = np.full((SECTORS, RINGS), np.nan)
    height[:, first:last:2] = height_m
    return height


@pytest.mark.parametrize("ceiling_m", [1.95, 2.0, 2.3, 2.6, 2.9])
def test_a_ceiling_is_as_high_in_one_cell_of_a_ray_as_in_the_next(ceiling_m):
    uneven = seen_from(14, 26, ceiling_m) + RNG.normal(0, 0.02, (SECTORS, RINGS))
    assert CEILING.height_m(tops(uneven), 0.0) == pytest.approx(ceiling_m, abs=0.02)


def test_a_slope_of_five_percent_is_a_ceiling():
    slope = seen_from(14, 24, 2.3) + 0.05 * GROUND.grid.range_m
    assert 2.4 < CEILING.height_m(tops(slope), 0.0) < 3.0


def test_the_vault_of_a_narrow_passage_is_a_ceiling_though_most_rays_end_at_its_sides():
    """A quarter of the rays goes along the passage; the others meet the curve of the vault at two heights."""
    along = np.arange(SECTORS)[:, None] % (SECTORS // 2) < SECTORS // 8
    sides = np.full((SECTORS, RINGS), np.nan)
    sides[:, 10] = 1.95
    sides[:, 12] = 2.25
    assert CEILING.height_m(tops(np.where(along, seen_from(14, 26, 2.5), sides)), 0.0) == pytest.approx(2.5)


@pytest.mark.parametrize(
    "height_m",
    [
        np.full((SECTORS, RINGS), np.nan),
        np.where(np.arange(SECTORS)[:, None] < 8, seen_from(14, 20, 2.3), np.nan),
        seen_from(20, 21, 2.2),
        seen_from(14, 26, RNG.uniform(1.9, 6.0, (SECTORS, 6))),
        seen_from(14, 26, 1.75),
        seen_from(14, 26, 3.2),
    ],
    ids=["nothing", "a lintel", "a wall", "trees", "cars", "a hall"],
)
def test_what_is_small_met_once_uneven_low_or_high_is_no_ceiling(height_m):
    assert CEILING.height_m(tops(height_m), 0.0) is None


def stage_of(sensor, height_m):
    """The segmenter of a shipped profile, at a known height."""
    return Segmenter(load(sensor).segmentation, replace(load(sensor).sensor, height_m=height_m), FieldOfView())


def test_the_lowest_returns_of_a_ceiling_above_the_greatest_height_used_join_nobody():
    """The ceiling is 2.65 to 2.7 m high, and some of its returns are lower than 2.6 m, over a walking person too."""
    stage = stage_of("mid-360", 0.3)
    for frame in SyntheticStream("hall", "mid-360", 4.0, 2101, height_m=0.3).between(8, 10):
        assert stage.above_ground(frame.points).height_m.max() < 2.5


PERSON = (5.0, 0.0, 0.4, 0.5, 0.0, 1.75)


@pytest.mark.parametrize(
    ("overhead", "height_m"),
    [
        ([(0, 0, 40, 40, 2.0, 2.2)], 0.8),
        ([(0, 0, 40, 40, 2.1, 2.3), (0, 2, 40, 0.3, 1.95, 2.1)], 0.8),
        ([(0, 0, 40, 40, 2.3, 2.5), (5, 0, 0.3, 10, 2.1, 2.3), (0, 0.2, 40, 0.1, 2.15, 2.25)], 0.8),
        ([(x, 0, 2, 40, 2.4 + 0.05 * x, 2.6 + 0.05 * x) for x in range(-9, 20, 2)], 0.8),
        ([(0, 0, 40, 40, 2.1, 2.3)], 1.7),
    ],
    ids=["low", "beam", "beam and pipe", "slope", "high sensor"],
)
def test_a_person_stands_apart_from_the_ceiling_and_what_hangs_from_it(overhead, height_m):
    points, on = scans.scan([PERSON, *overhead], height_m, elevation=scans.VLP_16)
    proposals = stage_of("vlp-16", height_m).segment(points)
    (own,) = set(proposals.label(len(points))[(on == 1) & (points[:, 2] > 0.4 - height_m)].tolist())
    members = proposals.members[proposals.offsets[own] : proposals.offsets[own + 1]]
    assert (on[members] == 1).all()
    assert (proposals.kind[(on > 1) & (points[:, 2] > 2.0 - height_m)] == PointKind.OVERHEAD).mean() > 0.99


def test_the_roofs_of_vans_below_a_high_sensor_are_no_ceiling():
    vans = [(x, y, 5.0, 2.0, 0.3, 2.0) for x in (-12, -6, 6, 12) for y in (-9, -6, -3, 3, 6, 9)]
    points, on = scans.scan(vans, 2.8, elevation=np.deg2rad(np.linspace(-25, 15, 64)))
    kind = stage_of("os1-64", 2.8).segment(points).kind
    assert not (kind[on > 0] == PointKind.OVERHEAD).any()


@pytest.mark.slow
@pytest.mark.parametrize(("sensor", "height_m"), [("vlp-16", 0.8), ("os1-64", 0.5), ("mid-360", 0.3)])
def test_people_under_a_low_ceiling_are_found_by_the_profile_of_the_sensor(sensor, height_m):
    """The hall is 2.5 m high. A person of 20 points or more is found if a proposal shares more than half of them."""
    stage, people, found = stage_of(sensor, height_m), 0, 0
    simulator = SyntheticStream("hall", sensor, 3.0, 901, height_m=height_m).simulator
    for frame, truth in (simulator.sweep(6 * k) for k in range(5)):
        proposals = stage.segment(frame.points)
        label = proposals.label(len(frame.points))
        for body in truth.bodies[truth.points >= 20].tolist():
            own = truth.instance == body
            shared = np.bincount(label[own][label[own] >= 0], minlength=len(proposals))
            people += 1
            found += bool((shared > 0.5 * (own.sum() + proposals.count - shared)).any())
    assert found >= 0.95 * people > 0


def test_a_street_has_no_ceiling():
    config = SegmentationConfig()
    stage = Segmenter(config, load("os1-64").sensor, FieldOfView())
    for frame in SyntheticStream("street", "os1-64", 0.3, 901):
        bounded = stage.kernels.above_ground(stage.ground, frame.points, 1.0, stage.bounds)
        assert stage.above_ground(frame.points).rows.tolist() == bounded.rows.tolist()
