"""Simulated sweeps without objects."""

from tests.tools.train.scans import assert_same, labels_of
from tools.train.bare_scans import bare_scans

SENSORS = ("vlp-16", "mid-360")


def test_a_bare_sweep_has_proposals_and_no_object():
    for scan in bare_scans([1, 2], SENSORS):
        assert scan.kinds == ()
        labels = labels_of(scan)
        assert len(labels.kind)
        assert not labels.kind.any()
        assert not labels.unknown.any()


def test_a_bare_sweep_is_the_same_whenever_it_is_made():
    assert_same(*(bare_scans([7, 8], SENSORS) for _ in range(2)))
