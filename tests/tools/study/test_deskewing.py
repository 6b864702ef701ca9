"""The study of deskewing: what is at rest is put where its returns come from, wherever a sweep is cut."""

import pytest

from tools.study.deskewing import CUTS_DEG, WITHOUT_CUT, Drive, figures, table

BAR_M = 0.08


@pytest.mark.parametrize(("sensor", "cuts"), [("vlp-16", ["ahead", "right"]), ("mid-360", [WITHOUT_CUT])])
def test_things_at_rest_are_put_where_they_are_at_6_mps(sensor, cuts):
    drive = Drive.simulated("street", sensor, 6.0, 1.2, seed=3)
    assert set(cuts) <= set(drive.cuts) <= {*CUTS_DEG, WITHOUT_CUT}
    for cut in cuts:
        found = figures(drive, cut)
        assert found["by poses"][0] < BAR_M
        assert found["by registration"][0] < BAR_M
        assert found["without times"][0] > 2 * BAR_M
    # The motion of each point is known where a pose is, so that nothing of the sweep is smeared.
    assert sensor != "mid-360" or found["by poses"][1] < BAR_M


def test_a_table_has_a_column_for_each_reading():
    head, rule = table([]).splitlines()
    assert head.count("|") == rule.count("|") == 9
