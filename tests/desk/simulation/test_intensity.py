"""Intensities are like those of a real HDL-64E, and have no effect on anything else."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt_desk.simulation.materials import Material
from modt_desk.simulation.raycast import RayCaster
from modt_desk.simulation.sensors import sensor
from modt_desk.simulation.simulator import Receiver
from modt_desk.simulation.solids import box
from modt_desk.simulation.synthetic_stream import SyntheticStream

HDL = sensor("hdl-64e")


def received(solid, offset=0.0):
    """Distances, intensities and rays of the returns of one solid, by an HDL-64E."""
    sky = np.full(HDL.shape, np.inf, np.float32)
    image = RayCaster(HDL).cast(solid, sky, np.ones_like(sky))
    material = np.full(HDL.shape, solid.material[0], np.uint8)
    receiver = Receiver(HDL, np.random.default_rng(0))
    offsets = np.array([offset, 0], np.float32)
    return receiver.receive(image.distance, material, image.solid, offsets, np.random.default_rng(1))


@given(
    st.lists(st.floats(-1, 3, width=32), min_size=2, max_size=20),
    st.floats(1, 120, width=32),
    st.sampled_from(["hdl-64e", "vlp-16"]),
)
def test_reported_intensities_are_steps_of_the_scale_and_increase(intensity, slant_m, name):
    response = sensor(name).response
    got = response.report(np.sort(np.array(intensity, np.float32)), np.full(len(intensity), slant_m, np.float32))
    assert 0 <= got.min() <= got.max() <= np.float32(response.most)
    np.testing.assert_allclose(got, np.rint(got * response.steps) / response.steps, atol=1e-6)
    assert (np.diff(got) >= 0).all()


def test_a_sweep_reports_0_to_0_99_with_more_zeros_at_range():
    frame, truth = next(SyntheticStream(seconds=0.1, seed=3).sweeps())
    value, away = frame.points[:, 3], np.linalg.norm(frame.points[:, :3], axis=1)
    assert value.min() == 0
    assert value.max() == np.float32(0.99)
    np.testing.assert_allclose(100 * value, np.rint(100 * value), atol=1e-4)
    scenery = np.isin(truth.semantic, (50, 70))
    dark = [
        (value[scenery & (away > a) & (away < b)] == 0).mean() for a, b in ((12, 20), (25, 35), (40, 50), (55, 70))
    ]
    assert dark == sorted(dark)
    assert dark[0] < 0.15 < 0.3 < dark[2] < 0.7 < dark[3]


def test_an_intensity_offset_changes_the_intensity_alone():
    wall = box((15.0, 0.0, 0.0), (0.2, 6.0, 3.0), Material.WALL)
    (distance, plain, ray), (same_distance, bright, same_ray) = received(wall), received(wall, 0.2)
    np.testing.assert_array_equal(distance, same_distance)
    np.testing.assert_array_equal(ray, same_ray)
    assert np.mean(bright - plain) == pytest.approx(0.2, abs=0.02)


def test_paint_is_darker_at_grazing_incidence():
    turned = [received(box((14.0, 0.0, 0.0), (0.1, 3.0, 1.0), Material.CAR_PAINT, yaw))[1] for yaw in (0.0, 0.8, 1.3)]
    means = [v.mean() for v in turned]
    assert means == sorted(means, reverse=True)
    assert means[2] < 0.6 * means[0]


def test_a_body_keeps_its_intensity_offset():
    stream = SyntheticStream(seconds=1.0, seed=3)
    seen = [stream.simulator.sweep(i) for i in (0, 3)]
    mean = []
    for frame, truth in seen:
        named = {b: frame.points[truth.instance == b, 3] for b in truth.bodies[truth.points > 300].tolist()}
        mean.append({b: v.mean() for b, v in named.items()})
    both = sorted(mean[0].keys() & mean[1].keys())
    a, b = (np.array([m[k] for k in both]) for m in mean)
    assert len(both) >= 4
    assert np.abs(a - b).mean() < 0.5 * a.std()
