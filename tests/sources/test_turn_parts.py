"""Messages that are parts of a turn, and those that are not."""

import numpy as np
import pytest

from modt.ros2.point_cloud2 import PointCloud
from modt.sources.turn_parts import TurnParts, arc_of

TURN_S = 0.1
N = 6000


def turns(n, way=1.0):
    """Bearing and time [s] of the points of turns that begin behind the sensor, and their (N, 4) points."""
    rng = np.random.default_rng(0)
    phase = np.linspace(0, 2 * np.pi * n, N * n, endpoint=False)
    bearing = np.pi - way * phase
    range_m = rng.uniform(3, 30, len(phase))
    points = np.stack([range_m * np.cos(bearing), range_m * np.sin(bearing), phase, np.full(len(phase), 0.5)], axis=1)
    return phase / (2 * np.pi) * TURN_S, points.astype(np.float32)


def parts(n_turns, per_turn, way=1.0, begin=0.0):
    """Messages of a share of a turn each, from a share of the first one on."""
    times_s, points = turns(n_turns, way)
    size = TURN_S / per_turn
    messages = []
    for k in range(int((n_turns - begin) * per_turn)):
        began_s = begin * TURN_S + k * size
        inside = (times_s >= began_s - 1e-9) & (times_s < began_s + size - 1e-9)
        stamp_s = 1000.0 + began_s
        messages.append((PointCloud(stamp_s, "lidar", points[inside], began_s=stamp_s), stamp_s + size))
    return messages


def joined(messages):
    joiner = TurnParts.of(messages[:50])
    made = [turn for message in messages if (turn := joiner.add(*message)) is not None]
    last = joiner.finish()
    return joiner, [*made, *([] if last is None else [last])]


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("per_turn", [2, 8, 4 / 3, 57.3, 5.5])
@pytest.mark.parametrize("begin", [0.0, 0.4])
def test_parts_are_joined_to_turns_from_behind_the_sensor(way, per_turn, begin):
    n = 8
    joiner, made = joined(parts(n, per_turn, way, begin))
    assert joiner.turn_s == pytest.approx(way * TURN_S, rel=0.02)
    assert n - 2 <= len(made) <= n
    first_turn = 0 if begin == 0.0 else 1
    for k, turn in enumerate(made[:-1], first_turn):
        assert turn.turn_s == joiner.turn_s
        assert turn.stamp_s == pytest.approx(1000.0 + (k + 0.5) * TURN_S, abs=0.06 * TURN_S)
        assert len(turn.points) == pytest.approx(N, abs=80)
        phase = turn.points[:, 2] - 2 * np.pi * k  # z tells when a point was seen
        assert (phase > -0.1).all()
        assert (phase < 2 * np.pi + 0.1).all()


def test_whole_turns_sectors_and_two_sensors_are_left_as_they_are():
    whole = parts(8, 1)
    assert TurnParts.of(whole) is None
    ahead = [(PointCloud(s, "lidar", c.points[c.points[:, 0] > 0], began_s=s), s) for c, s in whole]
    assert TurnParts.may_be([cloud for cloud, _ in ahead])
    assert TurnParts.of(ahead) is None
    two = [(PointCloud(c.stamp_s, f"lidar{k % 2}", c.points), s) for k, (c, s) in enumerate(parts(8, 2))]
    assert TurnParts.of(two) is None


def test_a_lost_part_costs_no_other_turn():
    messages = parts(8, 8)
    del messages[20]
    _, made = joined(messages)
    assert len(made) == 8
    assert sorted(len(turn.points) for turn in made)[0] == pytest.approx(N * 7 / 8, abs=80)


@pytest.mark.parametrize("per_turn", [2, 4, 8])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_two_parts_in_the_wrong_order_cost_no_turn(per_turn, way):
    messages = parts(12, per_turn, way)
    at = 6 * per_turn
    messages[at], messages[at + 1] = messages[at + 1], messages[at]
    _, made = joined(messages)
    assert len(made) == 12
    assert [len(turn.points) for turn in made] == pytest.approx([N] * 12, abs=80)


def test_few_points_tell_no_arc():
    assert arc_of(np.ones((10, 4), np.float32)).extent_rad == pytest.approx(2 * np.pi)
