"""The ceiling of a room is no object and joins none."""

from dataclasses import replace

import numpy as np
import pytest

from modt.config import SegmentationConfig
from modt.geometry import FieldOfView
from modt.profile import load
from modt.segmentation.ceiling import CeilingFinder
from modt.segmentation.segmenter import Segmenter
from modt_simulation.synthetic_stream import SyntheticStream

RNG = np.random.default_rng(0)
CEILING = CeilingFinder(2.6)
WALLS = RNG.uniform(0.3, 2.6, 2000)


@pytest.mark.parametrize(
    ("ceiling_m", "n", "cut_m"),
    [
        *((ceiling_m, 4000, (ceiling_m - 0.35, ceiling_m - 0.14)) for ceiling_m in (2.3, 2.4, 2.5, 2.62)),
        *((ceiling_m, n, None) for ceiling_m, n in ((2.5, 100), (2.5, 0), (2.0, 4000), (3.0, 4000))),
    ],
)
def test_a_ceiling_is_cut_just_below_but_few_returns_doors_and_what_is_higher_are_none(ceiling_m, n, cut_m):
    """Some returns of a ceiling lie 0.1 m below it."""
    height = np.concatenate([WALLS, RNG.normal(ceiling_m, 0.02, n)]).astype(np.float32)
    limit_m = CEILING.within_m(CEILING.histogram(height[height < 2.6]))
    assert (limit_m is None) if cut_m is None else (cut_m[0] < limit_m < cut_m[1])
    assert CEILING.within_m(CEILING.histogram(np.zeros(0, np.float32))) is None


@pytest.mark.parametrize(
    ("ceiling_m", "n", "is_cut"),
    [*((2.55 + 0.1 * k, 4000, True) for k in range(4)), (3.2, 4000, False), (2.65, 100, False), (2.65, 0, False)],
)
def test_a_ceiling_about_the_greatest_height_used_is_cut_well_below(ceiling_m, n, is_cut):
    level = np.concatenate([WALLS, RNG.normal(ceiling_m, 0.05, n)]).astype(np.float32)
    limit_m = CEILING.limit_m(np.zeros(CEILING.bins, np.int64), level, 0.0)
    assert (2.3 < limit_m < 2.5) if is_cut else (limit_m is None)


def stage_of(sensor, height_m):
    """The segmenter of a shipped profile, at a known height."""
    return Segmenter(load(sensor).segmentation, replace(load(sensor).sensor, height_m=height_m), FieldOfView())


def test_the_lowest_returns_of_a_ceiling_above_the_greatest_height_used_join_nobody():
    """The ceiling is 2.65 to 2.7 m high, and some of its returns are lower than 2.6 m, over a walking person too."""
    stage = stage_of("mid-360", 0.3)
    for frame in SyntheticStream("hall", "mid-360", 4.0, 2101, height_m=0.3).between(8, 10):
        assert stage.above_ground(frame.points).height_m.max() < 2.5


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
        bounded = stage.kernels.above_ground(stage.ground, stage.ceiling, frame.points, 1.0, stage.bounds)
        assert stage.above_ground(frame.points).rows.tolist() == bounded.rows.tolist()
