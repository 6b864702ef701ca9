"""People: on the ground, as tall as stated, legs moving when they walk."""

import numpy as np
import pytest

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
def test_people_stand_on_the_ground_with_the_stated_height_and_move_their_legs_when_they_walk(posture):
    people = group(posture)
    for time_s in np.linspace(0, 1.1, 7):
        solids = people.solids(time_s)
        np.testing.assert_allclose(np.linalg.det(solids.rotation.astype(float)), 1, atol=1e-4)
        reach = (np.abs(solids.rotation) @ solids.half[:, :, None])[:, 2, 0]
        for body in people.body:
            mine = solids.body == body
            assert -0.1 < (solids.centre[mine, 2] - reach[mine]).min() < 0.35
            if posture in (Posture.STAND, Posture.WALK):
                top_m = (solids.centre[mine, 2] + reach[mine]).max()
                assert top_m == pytest.approx(people.height[body], abs=0.12)
    a, b = people.solids(0.0).centre, people.solids(0.25).centre
    assert (np.abs(a - b).max() > 0.1) == (posture in (Posture.WALK, Posture.RIDE))
