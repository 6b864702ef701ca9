"""How much of a scene a picture shows."""

import numpy as np
import pytest

from modt.viewer.theme import REACH_M
from modt.viewer.track_rows import COLUMNS, SCALE
from modt_desk.viewer.recorded_tracks import reach_m


def rows(x, y, seen=1):
    table = np.zeros((len(x), len(COLUMNS)), np.int64)
    for name, values in {"x": x, "y": y}.items():
        table[:, COLUMNS.index(name)] = np.multiply(values, SCALE[name])
    table[:, COLUMNS.index("seen")] = seen
    return table


@pytest.mark.parametrize(
    ("x", "y", "reach"),
    [([3, -4], [0, 1], 6.0), ([3, 1], [0, 12], 20.0), ([-25], [2], 30.0), ([80], [2], REACH_M), ([], [], REACH_M)],
)
def test_a_room_is_shown_larger_than_a_street(x, y, reach):
    assert reach_m(rows(x, y)) == reach


def test_a_single_track_far_away_and_lost_ones_do_not_count():
    far, lost = rows([60], [0]), rows([60] * 50, [0] * 50, seen=0)
    assert reach_m(np.concatenate([rows(np.linspace(-8, 8, 40), np.zeros(40)), far, lost])) == 10.0
