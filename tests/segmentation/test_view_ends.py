"""Sides at which proposals end because the view ends."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.config import SensorConfig
from modt.geometry import upright_boxes
from modt.placement import Mount
from modt.segmentation.view_ends import ViewEnds
from modt.types import Cut

SENSOR = SensorConfig(
    height_m=0.3, min_range_m=0.2, elevation_step_deg=2.0, elevation_span_deg=(-15.0, 15.0), azimuth_step_deg=0.2
)


def person(distance_m, sensor=SENSOR, height_m=1.75):
    """(3, K) returns of an upright board as high as a person, 0.4 m wide, from all beams that meet it."""
    elevation, azimuth = np.meshgrid(
        np.deg2rad(np.arange(-15, 16, 2)), np.arctan(np.linspace(-0.2, 0.2, 9) / distance_m)
    )
    z = distance_m * np.tan(elevation) / np.cos(azimuth)
    shown = (z > -sensor.height_m) & (z < height_m - sensor.height_m)
    y = distance_m * np.tan(azimuth)
    return np.stack([np.full(shown.sum(), distance_m), y[shown], z[shown]]).astype(np.float32)


def flags(*parts, sensor=SENSOR):
    points, offsets = np.concatenate(parts, axis=1), np.cumsum([0, *(part.shape[1] for part in parts)])
    box = upright_boxes(points, offsets, np.zeros(len(parts)))
    return [Cut(flag) for flag in ViewEnds(sensor, 2.6).cut(points, offsets, box).tolist()]


EVEN, TABLE = SensorConfig(min_range_m=0.2), SensorConfig(min_range_m=0.2, elevations_deg=tuple(range(-15, 16, 2)))
NEAR = Cut.TOP | Cut.BOTTOM


@pytest.mark.parametrize(
    ("sensor", "cut"),
    [(SENSOR, [NEAR, Cut.TOP, Cut(0)]), (EVEN, [Cut(0)] * 3), (TABLE, [NEAR, Cut.TOP, Cut(0)])],
    ids=["span", "beams not known", "table"],
)
def test_a_person_near_a_low_sensor_is_cut_at_its_outermost_beams_and_one_farther_away_is_whole(sensor, cut):
    assert flags(person(1.0), person(3.0), person(8.0), sensor=sensor) == cut


@given(st.lists(st.integers(1, 6), min_size=1, max_size=5), st.integers(0, 2**32 - 1), st.floats(-180, 90))
def test_flags_are_those_of_a_loop_over_points(counts, seed, bound_deg):
    sensor = SensorConfig(
        min_range_m=0.5,
        elevation_step_deg=2.0,
        elevation_span_deg=(-15.0, 15.0),
        azimuth_step_deg=1.0,
        blind_sectors_deg=(bound_deg, bound_deg + 60.0),
        blind_range_m=1.2,
    )
    xyz = np.random.default_rng(seed).normal(0, 1.0, (3, sum(counts))).astype(np.float32)
    parts = np.split(xyz, np.cumsum(counts)[:-1], axis=1)
    steepest = np.tan(np.deg2rad(15.0)) - 0.75 * np.deg2rad(2.0)
    expected = []
    for part in parts:
        flag = Cut(0)
        for x, y, z in part.T.tolist():
            range_m = np.hypot(x, y)
            flag |= Cut.NEAR * int(range_m < 0.6) | Cut.TOP * int(z / range_m > steepest)
            flag |= Cut.BOTTOM * int(z / range_m < -steepest)
            off_deg = (np.rad2deg(np.arctan2(y, x)) - bound_deg - np.array([0.0, 60.0]) + 180.0) % 360.0 - 180.0
            flag |= Cut.SIDE * int((np.abs(off_deg) < 2.0).any() and range_m < sensor.blind_range_m)
        expected.append(flag)
    assert flags(*parts, sensor=sensor) == expected


@pytest.mark.parametrize(("roll_deg", "pitch_deg"), [(0.0, 12.0), (-10.0, 4.0), (180.0, 0.0)])
def test_the_view_of_a_tilted_sensor_ends_where_its_own_beams_do(roll_deg, pitch_deg):
    tilted = replace(SENSOR, roll_deg=roll_deg, pitch_deg=pitch_deg)
    mount = Mount.of(roll_deg, pitch_deg)
    parts = [mount.turn(np.ascontiguousarray(person(distance_m).T)).T for distance_m in (1.0, 8.0)]
    upright = person(1.6)  # whose feet the lowest beam shows, and not the head
    above = mount.turn(np.ascontiguousarray(upright[:, upright[2] > 0].T)).T
    cut_above = Cut.TOP if roll_deg < 90 else Cut.BOTTOM
    assert flags(*parts, above, sensor=tilted) == [Cut.TOP | Cut.BOTTOM, Cut(0), cut_above]
