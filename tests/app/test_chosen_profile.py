"""The profile of a stream: what the source knows of its sensor."""

import dataclasses

import pytest

from modt import profile
from modt.app.chosen_profile import FOUND, choose
from modt_desk.simulation.synthetic_stream import SyntheticStream

STREAM = SyntheticStream("street", "vlp-16", 0.1, 0)
TOLD = (-15.1, *(float(v) for v in range(-13, 14, 2)), 15.2)


@pytest.mark.parametrize(
    ("asked", "named", "sensor", "beams"),
    [
        ((), "vlp-16", "vlp-16", TOLD),
        ((), None, FOUND, TOLD),
        (("vlp-16",), None, "vlp-16", profile.load("vlp-16").sensor.elevations_deg),
    ],
    ids=["a known sensor", "an unknown one", "a profile that was asked for"],
)
def test_beams_that_the_source_knows_are_used_unless_a_sensor_is_asked_for(asked, named, sensor, beams):
    info = dataclasses.replace(STREAM.info, profile=named, elevations_deg=TOLD)
    for first in (None, next(iter(STREAM))):
        chosen = choose(asked, first, info)
        assert chosen.config.sensor.elevations_deg == beams
    assert chosen.sensor == sensor
