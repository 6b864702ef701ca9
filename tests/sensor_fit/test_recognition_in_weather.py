"""A sensor is recognised by its beams, whatever the air returns and however the robot moves."""

from dataclasses import replace

import numpy as np
import pytest

from modt import profile
from modt.app.chosen_profile import choose
from modt.geometry import inverse, transform
from modt.sensor_fit.recognition import recognise
from modt_simulation.synthetic_stream import SyntheticStream


@pytest.mark.parametrize("sensor", ["mid-360", "vlp-16"])
@pytest.mark.parametrize("weather", ["fog:100", "fog:50", "snow:2.5", "dust:1.5"])
def test_weather_makes_no_other_sensor(sensor, weather):
    frame, _ = SyntheticStream("yard", sensor, 2.0, 900, weather=weather).simulator.sweep(8)
    assert recognise(frame.points, profile.load(sensor)).differences == ()


def twisted(frame, world, turn_s=0.1):
    """The sweep, each bearing moved to the sensor frame at the time at which the head faces it."""
    points = frame.points.copy()
    delay_s = -np.arctan2(points[:, 1], points[:, 0]) * turn_s / (2 * np.pi)
    part = np.round(delay_s, 3)
    for late_s in np.unique(part).tolist():
        rows = part == late_s
        seen = transform(frame.T_world_sensor, points[rows, :3].astype(np.float64))
        points[rows, :3] = transform(inverse(world.ego_pose(frame.stamp_s + late_s)), seen)
    return replace(frame, points=points, T_world_sensor=None)


@pytest.mark.parametrize("seed", [900, 901, 902])
@pytest.mark.parametrize("as_driver", ["raw", "moved"])
def test_a_start_while_walking_names_the_sensor(seed, as_driver):
    stream = SyntheticStream("yard", "vlp-16", 3.0, seed, gait="6", distort=as_driver == "raw")
    frame, _ = stream.simulator.sweep(7)
    if as_driver == "moved":
        frame = twisted(frame, stream.simulator.world)
    assert choose(profile.resolve(), frame, None).recognition.nearest == "vlp-16"
    named = choose(profile.resolve(), frame, replace(stream.info, profile="vlp-16"))
    assert named.sensor == "vlp-16"
    assert choose(profile.resolve("vlp-16"), frame, None).recognition.differences == ()
