"""Limbs that bend, feet that reach the ground and stay with their owner."""

import numpy as np
import pytest

from modt.simulation.materials import Material
from modt.simulation.people import Figures, Posture


def figures(posture, n=8):
    rng = np.random.default_rng(0)
    one = np.ones(n)
    return Figures(
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
def test_figures_stand_on_the_ground_as_tall_as_they_are(posture):
    people = figures(posture)
    for time_s in np.linspace(0, 1.1, 7):
        pieces = people.pieces(time_s)
        assert np.isfinite(pieces.centre).all()
        np.testing.assert_allclose(np.linalg.det(pieces.rotation.astype(float)), 1, atol=1e-4)
        reach = np.abs(pieces.rotation) @ pieces.half[:, :, None]
        low = pieces.centre[:, 2] - reach[:, 2, 0]
        high = pieces.centre[:, 2] + reach[:, 2, 0]
        for body in people.body:
            mine = pieces.body == body
            assert -0.1 < low[mine].min() < 0.35
            if posture in (Posture.STAND, Posture.WALK):
                assert high[mine].max() == pytest.approx(people.height[body], abs=0.12)


def test_walkers_move_their_legs_and_standers_do_not():
    for posture, moves in ((Posture.WALK, True), (Posture.STAND, False)):
        people = figures(posture)
        a, b = people.pieces(0.0).centre, people.pieces(0.25).centre
        assert (np.abs(a - b).max() > 0.1) == moves


def test_a_strip_is_worn_about_the_chest_by_those_who_have_one():
    people = figures(Posture.WALK)
    strips = people.pieces(0.4).take(people.pieces(0.4).material == Material.RETRO)
    assert strips.body.tolist() == np.flatnonzero(people.strip).tolist()
    np.testing.assert_allclose(2 * strips.half[:, 2], 0.07, atol=1e-4)
    share = strips.centre[:, 2] / people.height[strips.body]
    assert (share > 0.6).all()
    assert (share < 0.75).all()
