"""Tables over mounts, boards and sensors."""

import numpy as np
import pytest

from modt.classes import ObjectClass
from modt.placement import Mount
from modt_desk.simulation.synthetic_stream import SyntheticStream
from tools.study import mounts
from tools.study.boards import BOARDS, Work, rating_of, table
from tools.study.segmentation_recall import Tally
from tools.train.synthetic_scans import simulated_scans


@pytest.mark.slow
def test_a_row_over_mounts_has_recall_and_precision_of_people():
    stream = SyntheticStream("crowd", "vlp-16", 1.0, 3, height_m=0.8, mount_deg=(0.0, 10.0))
    drive = mounts.run(stream, "accurate", mounts.of_mount("vlp-16", 0.8), Mount.of(0.0, 10.0))
    *_, people, _cars = mounts.row("vlp-16", [drive]).strip("| ").split(" | ")
    number, _, shares = people.partition(": ")
    detected, recall, precision = map(int, shares.split(" / "))
    assert int(number) > 10
    assert 50 < recall <= detected <= 100
    assert 50 < precision <= 100


def test_times_on_boards_are_scaled_by_their_ratings_at_full_usage():
    printed = "Avr:       711    25   3041    751\nTot:              27   3319    886\n"
    assert rating_of(printed) == 3319
    with pytest.raises(ValueError, match="no line Tot"):
        rating_of(printed.replace("Tot", "Sum"))
    *_, row = table([Work("os1-64", "accurate", 65536.4, 120.0, 3.25, 6.0)], 4 * 1752).splitlines()
    assert "24 ms" in row
    assert row.count("|") == 5 + len(BOARDS) + 1


def test_objects_of_a_scan_are_counted_by_class():
    (scan,) = simulated_scans(["street"], [3], [0.0], camera=False, sensors=["vlp-16"])
    tally = Tally()
    tally.add(scan)
    visible = [k for k, own in zip(scan.kinds, scan.objects, strict=True) if len(own) >= 20]
    assert tally.objects.tolist() == np.bincount(visible, minlength=4).tolist()
    assert tally.objects[ObjectClass.CAR] > 3
    assert tally.detected[ObjectClass.CAR] > 0.5 * tally.objects[ObjectClass.CAR]
    assert (tally.detected <= tally.objects).all()
    assert "x" in tally.row("x")
