"""Returns of the air are told from those of surfaces by the rays that pass."""

import numpy as np
import pytest

from modt.config import SegmentationConfig, SensorConfig
from modt.geometry import FieldOfView
from modt.segmentation.kernels import NUMPY
from modt.segmentation.porosity import RayDensity
from modt.segmentation.segmenter import Segmenter
from modt.types import PointKind
from tests.segmentation import scans

PERSON = (4.0, 0.0, 0.3, 0.5, 0.0, 1.75)
STEP_DEG = 0.4
SENSOR = SensorConfig(
    min_range_m=1.0, azimuth_step_deg=STEP_DEG, elevation_step_deg=2.0, elevation_span_deg=(-15, 15)
)
AIR = -1


def hazy(share):
    """A scan in which a share of the rays ends in the air on the way; what each point lies on, AIR of the air."""
    rng = np.random.default_rng(0)
    points, on = scans.scan((PERSON,), elevation=scans.VLP_16, step_deg=STEP_DEG)
    range_m = np.linalg.norm(points[:, :3], axis=1)
    ends_m = rng.uniform(1.5, 7.0, len(points))
    in_air = (rng.random(len(points)) < share) & (ends_m < range_m)
    points[in_air, :3] *= (ends_m / range_m)[in_air, None]
    return points, np.where(in_air, AIR, on)


def segmented(points):
    return Segmenter(SegmentationConfig(), SENSOR, FieldOfView(), NUMPY).segment(points)


@pytest.mark.parametrize("share", [0.05, 0.2, 0.4])
def test_a_person_in_haze_is_the_only_proposal(share):
    points, on = hazy(share)
    proposals = segmented(points)
    is_high = points[:, 2] > -1.73 + 0.5
    assert len(proposals) == 1
    assert (on[proposals.members] == 1).mean() > 0.95
    assert (proposals.kind[(on == 1) & is_high] == PointKind.MEMBER).mean() > 0.9
    assert (proposals.kind[(on == AIR) & is_high] == PointKind.AIRBORNE).mean() > 0.9


def test_clear_air_has_nothing_airborne():
    points, _ = hazy(0.0)
    assert not (segmented(points).kind == PointKind.AIRBORNE).any()


def test_a_sweep_thinner_than_the_profile_is_not_air():
    points, on = scans.scan((PERSON,), elevation=scans.VLP_16, step_deg=3 * STEP_DEG)
    rays = RayDensity(SENSOR)
    rays.update(points)
    assert 0.28 < rays.density < 0.38
    proposals = segmented(points)
    assert (on[proposals.members] == 1).all()
    assert not (proposals.kind == PointKind.AIRBORNE).any()


def test_rays_set_to_one_place_do_not_raise_the_density():
    points, _ = scans.scan((), elevation=scans.VLP_16, step_deg=3 * STEP_DEG)
    lost = np.tile(np.float32([[1.0, 0.1, -0.1, 0.0], [1.0, 0.5, -0.1, 0.0]]), (len(points), 1))
    rays = RayDensity(SENSOR)
    rays.update(np.concatenate([points, lost]))
    assert 0.28 < rays.density < 0.38


def test_the_density_is_at_most_the_one_of_the_profile():
    points, _ = scans.scan((PERSON,), elevation=scans.VLP_16, step_deg=STEP_DEG / 3)
    rays = RayDensity(SENSOR)
    rays.update(points)
    assert rays.density == 1.0


def leaves(share):
    """A scan of a person and of a bush in which a share of the rays ends; what each lies on, AIR of it."""
    rng = np.random.default_rng(0)
    centre = (3.0, 3.0, 0.0)
    radius_m = 1.0
    points, on = scans.scan((PERSON,), elevation=scans.VLP_16, step_deg=STEP_DEG)
    range_m = np.linalg.norm(points[:, :3], axis=1)
    direction = points[:, :3] / range_m[:, None]
    along_m = direction @ centre
    apart_m = np.sqrt(np.maximum(np.dot(centre, centre) - along_m**2, 0.0))
    half_m = np.sqrt(np.maximum(radius_m**2 - apart_m**2, 0.0))
    ends_m = rng.uniform(along_m - half_m, along_m + half_m)
    in_leaves = (along_m > 0) & (half_m > 0) & (ends_m < range_m) & (rng.random(len(points)) < share)
    points[in_leaves, :3] = (direction * ends_m[:, None])[in_leaves]
    return points, np.where(in_leaves, AIR, on)


def test_leaves_are_not_of_the_air():
    points, on = leaves(0.2)
    kind = segmented(points).kind
    assert (on == AIR).sum() > 40
    assert not (kind == PointKind.AIRBORNE).any()
    assert (kind[(on == AIR) & (points[:, 2] > -1.0)] == PointKind.SPARSE).mean() > 0.5


def test_a_flake_in_every_direction_is_of_the_air():
    points, on = hazy(0.02)
    assert (segmented(points).kind[on == AIR] == PointKind.AIRBORNE).mean() > 0.5
