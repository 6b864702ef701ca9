"""People: on the ground, as tall as stated, legs moving when they walk."""

import numpy as np
import pytest

from modt_desk.simulation.materials import Material
from modt_desk.simulation.people import People, Posture


def group(posture, n=8):
    rng = np.random.default_rng(0)
    one = np.ones(n)
    return People(
        body=np.arange(n),
        posture=np.full(n, posture),
        height=rng.uniform(1.2, 2.0, n),
        girth=one,
        phase=rng.uniform(0, 6, n),
        rate=6 * one,
        stride=0.35 * one,
        coat=1e-3 * one,
        pack=1e-3 * one,
        strip=0.07 * (np.arange(n) % 2),
    )


@pytest.mark.parametrize("posture", Posture)
def test_people_stand_on_the_ground_with_the_stated_height(posture):
    people = group(posture)
    for time_s in np.linspace(0, 1.1, 7):
        solids = people.solids(time_s)
        assert np.isfinite(solids.centre).all()
        np.testing.assert_allclose(np.linalg.det(solids.rotation.astype(float)), 1, atol=1e-4)
        reach = np.abs(solids.rotation) @ solids.half[:, :, None]
        low = solids.centre[:, 2] - reach[:, 2, 0]
        high = solids.centre[:, 2] + reach[:, 2, 0]
        for body in people.body:
            mine = solids.body == body
            assert -0.1 < low[mine].min() < 0.35
            if posture in (Posture.STAND, Posture.WALK):
                assert high[mine].max() == pytest.approx(people.height[body], abs=0.12)


def test_only_walking_people_move_their_legs():
    for posture, moves in ((Posture.WALK, True), (Posture.STAND, False)):
        people = group(posture)
        a, b = people.solids(0.0).centre, people.solids(0.25).centre
        assert (np.abs(a - b).max() > 0.1) == moves


def test_reflective_strips_are_at_the_chest():
    people = group(Posture.WALK)
    strips = people.solids(0.4).take(people.solids(0.4).material == Material.RETRO)
    assert strips.body.tolist() == np.flatnonzero(people.strip).tolist()
    np.testing.assert_allclose(2 * strips.half[:, 2], 0.07, atol=1e-4)
    share = strips.centre[:, 2] / people.height[strips.body]
    assert (share > 0.6).all()
    assert (share < 0.75).all()
