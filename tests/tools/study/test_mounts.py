"""The table over mounts."""

import pytest

from modt.placement import Mount
from modt_desk.simulation.synthetic_stream import SyntheticStream
from tools.study.mounts import of_mount, row, run


@pytest.mark.slow
def test_a_row_has_recall_and_precision_of_people():
    stream = SyntheticStream("crowd", "vlp-16", 1.0, 3, height_m=0.8, mount_deg=(0.0, 10.0))
    drive = run(stream, "accurate", of_mount("vlp-16", 0.8), Mount.of(0.0, 10.0))
    *_, people, _cars = row("vlp-16", [drive]).strip("| ").split(" | ")
    number, _, shares = people.partition(": ")
    detected, recall, precision = map(int, shares.split(" / "))
    assert int(number) > 10
    assert 50 < recall <= detected <= 100
    assert 50 < precision <= 100
