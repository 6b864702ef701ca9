"""Single beams and narrow sectors without returns are reported with which, and with nothing wrong none is."""

from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest

from modt.config import SensorConfig
from modt.profile import load
from modt.trust.lasting import BeamHistory, SectorHistory
from modt.trust.sample import sample
from modt.trust.tuning import LastingTuning
from modt.types import Frame
from modt_simulation.synthetic_stream import SyntheticStream
from tests.segmentation.scans import elevation_deg

LOOK_S = 0.6
SENSOR = load("vlp-16").sensor


@cache
def sweeps():
    """Sweeps of a robot in a yard, of which the last ones are repeated as if it stood."""
    return [frame.points for frame in SyntheticStream("yard", "vlp-16", 1.0, seed=12)]


def looks(fault=None, from_s=0.0, seconds=30.0, sensor=SENSOR, slow_fault=None):
    """Sample of each look at the sweeps, with a fault from a time on, or one that knows the time since then."""
    for k in range(int(seconds / LOOK_S)):
        time_s = k * LOOK_S
        points = sweeps()[k % len(sweeps())]
        if fault and time_s >= from_s:
            points = fault(points)
        if slow_fault and time_s >= from_s:
            points = slow_fault(points, time_s - from_s)
        yield sample(Frame(k, time_s, points), np.eye(4), sensor, np.zeros(3))


def bearing_deg(points):
    return np.rad2deg(np.arctan2(points[:, 1], points[:, 0]))


def without_beam(at_deg):
    return lambda points: points[np.abs(elevation_deg(points) - at_deg) > 1.0]


def without_sector(from_deg, width_deg=30.0):
    return lambda points: points[(bearing_deg(points) - from_deg) % 360 >= width_deg]


def closing(from_deg, width_deg, within_s):
    """A sector whose far edge grows until the time given."""
    return lambda points, since_s: without_sector(from_deg, width_deg * min(since_s / within_s, 1.0))(points)


def fading(from_deg, width_deg, within_s):
    """A sector that loses more and more returns, by chance, until the time given."""

    def fault(points, since_s):
        rng = np.random.default_rng(round(10 * since_s))
        inside = (bearing_deg(points) - from_deg) % 360 < width_deg
        return points[~(inside & (rng.random(len(points)) < since_s / within_s))]

    return fault


def followed(history, samples, name):
    """Time and an attribute of a history after each sample."""
    found = []
    for each in samples:
        history.add(each)
        found.append((each.time_s, getattr(history, name)))
    return found


dead_deg = partial(followed, name="dead_deg")
blocked_deg = partial(followed, name="blocked_deg")


@pytest.mark.parametrize("from_s", [0.0, 9.0])
@pytest.mark.parametrize("at_deg", [1.0, -1.0, -7.0])
def test_a_dead_beam_is_named_within_20_s(at_deg, from_s):
    found = dead_deg(BeamHistory(SENSOR, LastingTuning()), looks(without_beam(at_deg), from_s))
    first_s = next(time_s for time_s, dead in found if dead)
    assert from_s < first_s <= from_s + 20.0
    assert found[-1][1] == (at_deg,)


def test_a_beam_of_a_table_that_never_had_a_return_is_not_dead():
    table = replace(SENSOR, elevations_deg=SENSOR.beam_elevations_deg)
    assert dead_deg(BeamHistory(table, LastingTuning()), looks(without_beam(1.0)))[-1][1] == ()
    later = dead_deg(BeamHistory(table, LastingTuning()), looks(without_beam(1.0), 9.0))
    assert later[-1][1] == (1.0,)


def test_two_dead_beams_side_by_side_are_named():
    both = lambda points: without_beam(1.0)(without_beam(-1.0)(points))  # noqa: E731
    assert dead_deg(BeamHistory(SENSOR, LastingTuning()), looks(both))[-1][1] == (1.0, -1.0)


def test_a_beam_that_returns_is_withdrawn():
    history = BeamHistory(SENSOR, LastingTuning())
    samples = [*looks(without_beam(1.0), seconds=12.0), *looks(seconds=30.0)]
    later = [replace(each, time_s=each.time_s + 12.0) for each in samples[20:]]
    assert dead_deg(history, [*samples[:20], *later])[-1][1] == ()


def test_no_beam_is_dead_where_all_return():
    assert not any(dead for _, dead in dead_deg(BeamHistory(SENSOR, LastingTuning()), looks()))


def test_beams_of_a_tilted_sensor_are_told_in_its_own_frame():
    c, s = np.cos(np.deg2rad(8.0)), np.sin(np.deg2rad(8.0))
    R = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    level = lambda each: replace(each, raw=each.raw[:, :3] @ R.T.astype(np.float32), R_level_sensor=R)  # noqa: E731
    history = BeamHistory(SENSOR, LastingTuning())
    assert dead_deg(history, map(level, looks(without_beam(1.0))))[-1][1] == (1.0,)


@pytest.mark.parametrize(
    "sensor",
    [SensorConfig(), replace(SENSOR, elevation_span_deg=(-16.0, 14.0))],
    ids=["unknown beams", "beams of another sensor"],
)
def test_beams_that_are_not_known_are_not_judged(sensor):
    history = BeamHistory(sensor, LastingTuning())
    assert not any(dead for _, dead in dead_deg(history, looks(without_beam(1.0), sensor=sensor)))


@pytest.mark.parametrize("from_s", [0.0, 9.0])
@pytest.mark.parametrize("from_deg", [0.0, 123.0, 170.0])
def test_a_blocked_sector_of_30_deg_is_named_within_20_s(from_deg, from_s):
    found = blocked_deg(SectorHistory(SENSOR, LastingTuning()), looks(without_sector(from_deg), from_s))
    first_s = next(time_s for time_s, blocked in found if blocked)
    assert from_s < first_s <= from_s + 20.0
    first_deg, last_deg = found[-1][1]
    assert 25 <= last_deg - first_deg <= 30
    assert 0 <= (first_deg - from_deg) % 360 < 5


@pytest.mark.parametrize("within_s", [5.0, 15.0, 30.0, 60.0])
@pytest.mark.parametrize("width_deg", [30.0, 60.0, 90.0, 180.0])
@pytest.mark.parametrize("from_deg", [0.0, 123.0])
def test_a_sector_that_closes_slowly_is_named_within_15_s(from_deg, width_deg, within_s):
    begin_s = 10.0
    closed_s = begin_s + within_s * 30.0 / width_deg
    samples = looks(None, begin_s, closed_s + 15.0, slow_fault=closing(from_deg, width_deg, within_s))
    first_s, (first_deg, _) = next(
        each for each in blocked_deg(SectorHistory(SENSOR, LastingTuning()), samples) if each[1]
    )
    assert first_s > closed_s - 5.0
    assert 0 <= (first_deg - from_deg) % 360 < 5


@pytest.mark.parametrize("within_s", [5.0, 60.0])
@pytest.mark.parametrize("width_deg", [30.0, 180.0])
def test_a_sector_that_fades_is_named_within_15_s_of_its_last_return(width_deg, within_s):
    samples = looks(None, 10.0, 25.0 + within_s, slow_fault=fading(20.0, width_deg, within_s))
    first_deg, last_deg = blocked_deg(SectorHistory(SENSOR, LastingTuning()), samples)[-1][1]
    assert (first_deg, last_deg) == (20, 20 + width_deg)


def test_a_drop_to_which_the_robot_drives_is_not_reported():
    def before_drop(points, since_s):
        """The returns of the ground before a drop to the left, and nothing beyond it."""
        to_drop_m = max(12.0 - since_s, 1.5)
        return points[points[:, 1] < to_drop_m]

    found = blocked_deg(SectorHistory(SENSOR, LastingTuning()), looks(None, 5.0, 60.0, slow_fault=before_drop))
    assert not any(blocked for _, blocked in found)


def test_a_view_that_ends_slowly_where_no_ground_was_met_is_not_reported():
    high = lambda points: points[points[:, 2] > -0.1 * np.hypot(points[:, 0], points[:, 1])]  # noqa: E731
    closing_high = lambda points, since_s: high(closing(0.0, 90.0, 30.0)(points, since_s))  # noqa: E731
    samples = [*looks(high, seconds=9.6), *looks(None, 9.6, 60.0, slow_fault=closing_high)][16:]
    assert not any(blocked for _, blocked in blocked_deg(SectorHistory(SENSOR, LastingTuning()), samples))


def test_no_sector_is_blocked_where_all_return():
    assert not any(blocked for _, blocked in blocked_deg(SectorHistory(SENSOR, LastingTuning()), looks()))


def test_a_sector_that_the_profile_states_is_not_reported():
    sensor = replace(SENSOR, blind_sectors_deg=(-5.0, 35.0))
    history = SectorHistory(sensor, LastingTuning())
    assert not any(blocked for _, blocked in blocked_deg(history, looks(without_sector(0.0), sensor=sensor)))


def test_a_view_that_is_narrow_by_design_is_not_reported():
    found = blocked_deg(SectorHistory(SENSOR, LastingTuning()), looks(without_sector(60.0, 240.0)))
    assert not any(blocked for _, blocked in found)


@pytest.mark.parametrize("within_s", [0.1, 30.0])
def test_a_wall_nearer_than_the_sensor_sees_is_not_reported(within_s):
    def beside_wall(points, since_s):
        """A wall to the left whose parts ahead and behind are just in range."""
        points = closing(60.0, 60.0, within_s)(points, since_s)
        edge_deg = np.repeat([58.0, 122.0], 40)
        xy = 0.8 * np.stack([np.cos(np.deg2rad(edge_deg)), np.sin(np.deg2rad(edge_deg))], axis=1)
        return np.concatenate([points, np.column_stack([xy, np.zeros((80, 2))])]).astype(np.float32)

    found = blocked_deg(SectorHistory(SENSOR, LastingTuning()), looks(None, 9.0, slow_fault=beside_wall))
    assert not any(blocked for _, blocked in found)


def test_a_sector_that_is_uncovered_is_withdrawn():
    history = SectorHistory(SENSOR, LastingTuning())
    covered = list(looks(without_sector(0.0), 9.0, 24.0))
    uncovered = [replace(each, time_s=each.time_s + 24.0) for each in looks(seconds=3.0)]
    assert blocked_deg(history, covered)[-1][1] is not None
    assert blocked_deg(history, uncovered)[-1][1] is None
