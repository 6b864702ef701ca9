"""Simulated sweeps of people in all postures, and of what is taken for them."""

import numpy as np
import pytest

from modt.classes import ObjectClass
from modt_simulation.builder import LOW_M
from modt_simulation.people import PERSON, Person, Posture, people_solids
from tests.tools.train.scans import assert_same, labels_of
from tools.train.people_scans import LOW_WAYS, WAYS, people_scans, people_scene

SENSORS = ("vlp-16", "mid-360")


def test_a_sweep_has_people_and_things():
    for scan in people_scans([1, 2], SENSORS):
        assert set(scan.kinds) <= {ObjectClass.PEDESTRIAN, ObjectClass.BACKGROUND}
        labels = labels_of(scan)
        assert (labels.kind == ObjectClass.PEDESTRIAN).any()
        assert (labels.majority == ObjectClass.BACKGROUND).any()


def test_a_sweep_is_the_same_whenever_it_is_made():
    assert_same(*(people_scans([7, 8], SENSORS) for _ in range(2)))


def _low_people(ways) -> int:
    """People in postures near the ground in four worlds."""
    worlds = [people_scene(np.random.default_rng(seed), 1.0, ways) for seed in range(4)]
    return sum(body.size in LOW_M.values() for world in worlds for body in world.bodies)


def test_more_people_are_low_where_it_is_asked_for():
    assert _low_people(LOW_WAYS) > 1.4 * _low_people(WAYS) > 0


def _top_m(posture: Posture, height: float = 1.7, **joints: float) -> float:
    """Height of the top of a person."""
    person = Person(0, posture, height, 1.0, 0.0, 0.0, 0.0, 1e-3, 1e-3, 0.0, **joints)
    solids = people_solids(np.array([person], PERSON), 0.0)
    reach = np.abs(solids.rotation) @ solids.half[:, :, None]
    return float((solids.centre[:, 2] + reach[:, 2, 0]).max())


@pytest.mark.parametrize(
    ("posture", "least", "most"),
    [(Posture.STAND, 1.6, 1.9), (Posture.CROUCH, 0.8, 1.2), (Posture.FLOOR, 0.7, 1.1), (Posture.LIE, 0.2, 0.5)],
)
def test_a_posture_has_its_height(posture, least, most):
    assert least < _top_m(posture) < most


def test_who_bends_is_lower_and_a_child_is_lower():
    assert _top_m(Posture.STAND, lean=1.2) < _top_m(Posture.STAND) - 0.2
    assert _top_m(Posture.STAND, height=0.9) < 1.05
