"""Things lower than what is clustered, and the feet of what stands."""

import numpy as np
import pytest

from modt.config import SegmentationConfig, SensorConfig
from modt.geometry import FieldOfView
from modt.segmentation.segmenter import Segmenter
from modt.types import PointKind
from tests.segmentation import scans

BALL = (0.22, 0.22, 0.0, 0.22)
LYING = (1.8, 0.5, 0.0, 0.24)
ROBOT = (0.7, 0.5, 0.05, 0.42)
PERSON = (0.3, 0.5, 0.0, 1.75)
ELEVATION = np.deg2rad(np.linspace(-24, 10, 64))


def segmented(boxes, rough_m=0.0, height_m=0.8):
    """Proposals of a scene, and (n,) what each point lies on."""
    points, on = scans.scan(boxes, height_m, ELEVATION, step_deg=0.2)
    points[:, 2] += np.random.default_rng(1).normal(0, rough_m, len(points)).astype(np.float32)
    sensor = SensorConfig(height_m=height_m, min_range_m=0.5, elevation_step_deg=0.54, azimuth_step_deg=0.2)
    return Segmenter(SegmentationConfig(), sensor, FieldOfView()).segment(points), on


@pytest.mark.parametrize("rough_m", [0.0, 0.01])
@pytest.mark.parametrize(
    ("x", "thing"), [(4.0, BALL), (2.5, LYING), (5.0, LYING), (6.0, LYING), (4.0, ROBOT), (9.0, ROBOT)]
)
def test_a_low_thing_is_a_proposal(x, thing, rough_m):
    proposals, on = segmented([(x, 1.0, *thing)], rough_m)
    assert len(proposals) == 1
    assert (on[proposals.members] == 1).mean() > 0.95
    assert len(proposals.members) > 0.5 * (on == 1).sum()


@pytest.mark.parametrize("rough_m", [0.0, 0.01, 0.02, 0.03])
def test_rough_ground_is_no_low_thing(rough_m):
    proposals, on = segmented([], rough_m)
    assert len(proposals) == 0
    assert (proposals.kind[on == 0] != PointKind.GROUND).mean() < 0.002


def test_a_kerb_is_above_the_ground_but_no_proposal():
    proposals, on = segmented([(6.0, 0.0, 0.3, 8.0, 0.0, 0.2)])
    assert len(proposals) == 0
    assert (proposals.kind[on == 1] == PointKind.LOW).mean() > 0.5


def test_feet_belong_to_what_stands_on_them():
    proposals, on = segmented([(5.0, 0.0, *PERSON)])
    (foot, beside) = proposals.feet
    assert len(foot) > 20
    assert (on[foot] == 1).mean() > 0.95
    assert np.isin(beside, proposals.members).all()
    assert (on[proposals.members] == 1).all()
    assert len(foot) + len(proposals.members) > 0.97 * (on == 1).sum()
