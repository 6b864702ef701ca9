"""Sectors in which the sensor sees the robot, and segmentation without them."""

import dataclasses

import numpy as np
import pytest

from modt import profile
from modt.app import assembly
from modt.geometry import FieldOfView
from modt.geometry.field_of_view import BlindSectors
from modt.types import Frame
from tests.sensor_fit.recordings import recording, with_mast


def at(azimuth_deg, range_m):
    azimuth = np.deg2rad(np.asarray(azimuth_deg, np.float32))
    return np.stack([range_m * np.cos(azimuth), range_m * np.sin(azimuth), 0 * azimuth], axis=1).astype(np.float32)


@pytest.mark.parametrize(
    ("bounds_deg", "inside_deg", "outside_deg"),
    [
        ((10, 20), [11, 19], [9, 21, -15, 190]),
        ((170, -170), [175, 180, -175], [165, -165, 0]),
        ((350, 370), [-5, 5], [-11, 11]),
        ((-180, 180), [-179, -90, 0, 90, 179], []),
        ((10, 20, -20, -10), [15, -15], [0, 180]),
    ],
)
def test_sectors_go_counter_clockwise(bounds_deg, inside_deg, outside_deg):
    sectors = BlindSectors(bounds_deg, 2.0)
    assert sectors.contain(at(inside_deg, 1.9)).all()
    assert not sectors.contain(at(inside_deg, 2.1)).any()
    assert not sectors.contain(at(outside_deg, 1.9)).any()


@pytest.mark.slow
def test_the_robot_itself_is_no_proposal():
    points = with_mast(recording("vlp-16"), 150.0, 1.9).sweeps[0]
    config = profile.load("vlp-16")
    sensor = dataclasses.replace(config.sensor, blind_sectors_deg=(140.0, 160.0), blind_range_m=2.5)
    sighted = dataclasses.replace(config, sensor=sensor)
    mode = assembly.MODES["accurate"]
    stages = [assembly.pipeline(mode, c, FieldOfView()) for c in (config, sighted)]
    members = [stage.view.segment(Frame(0, 0.0, points)).members for stage in stages]
    mast = len(points) - 800
    assert (members[0] >= mast).any()
    assert not (members[1] >= mast).any()
    assert len(members[1]) > 0.8 * (members[0] < mast).sum()
