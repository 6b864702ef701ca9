"""Scenes in which obstacles are easily lost hold the people, movers and ceilings that they are made for."""

import numpy as np
import pytest

from modt.classes import ObjectClass
from modt.geometry import transform
from modt_simulation.movers import MAKERS
from modt_simulation.obstacles import GAPS_M
from modt_simulation.synthetic_stream import SyntheticStream


def world_of(scene, seed, **more):
    return SyntheticStream(scene, "vlp-16", 4.0, seed, **more).simulator.world


@pytest.mark.parametrize("seed", range(4))
def test_people_of_the_wall_are_as_close_as_they_are_said_to_be(seed):
    world = world_of("wall", seed)
    boxes = world.boxes(2.0)
    (wall,) = (b for b in world.bodies if not b.kind.name and b.size[0] == 50.0)
    front = wall.path.at(0.0)[1] - wall.size[1] / 2
    at_wall = {
        body.role: front - box[1] for body, box in zip(world.bodies, boxes, strict=True) if "wall" in body.role
    }
    for gap in GAPS_M:
        assert at_wall[f"stands {gap:g} m from a wall"] == pytest.approx(gap + 0.2)
        assert at_wall[f"walks {gap:g} m from a wall"] == pytest.approx(gap + 0.3)
    roles = [body.role for body in world.bodies]
    assert {
        role: roles.count(role) for role in ("in a doorway", "at a car's door", "between cars", "in a queue")
    } == {
        "in a doorway": 1,
        "at a car's door": 1,
        "between cars": 3,
        "in a queue": 4,
    }


@pytest.mark.parametrize("seed", range(3))
def test_the_ceiling_of_the_car_park_is_low(seed):
    frame, truth = SyntheticStream("carpark", "os1-64", 0.1, seed, height_m=0.5).simulator.sweep(0)
    z = transform(frame.T_world_sensor, frame.points[:, :3].astype(np.float64))[:, 2]
    assert 1.95 < np.quantile(z, 0.99) < 2.35
    assert truth.points[[kind.object_class == ObjectClass.CAR for kind in truth.kinds]].sum() > 1000


def test_movers_pass_at_half_time_and_have_no_class():
    seen = set()
    for seed in range(24):
        world = world_of("movers", seed)
        for body in world.bodies:
            if not body.path.at_rest and not body.role.startswith("pushes"):
                seen.add(body.role)
                assert body.kind.object_class == ObjectClass.BACKGROUND
                assert 2.9 < np.hypot(*body.path.at(2.0)[:2]) < 9.1
    assert seen == {maker.__name__ for maker in MAKERS}


def test_who_lies_is_low_and_who_crouches_lower_than_who_stands():
    stream = SyntheticStream("lying", "os1-128", 0.1, 1, height_m=1.2)
    frame, truth = stream.simulator.sweep(0)
    z = transform(frame.T_world_sensor, frame.points[:, :3].astype(np.float64))[:, 2]
    bodies = stream.simulator.world.bodies
    tops = {}
    for body, n in zip(truth.bodies.tolist(), truth.points.tolist(), strict=True):
        if n > 100:
            tops.setdefault(bodies[body].role, []).append(z[truth.instance == body].max())
    assert np.max(tops["lies"]) < 0.5
    assert 0.7 < np.median(tops["crouches"]) < np.median(tops["kneels"]) < 1.5


def test_stairs_rise_ahead_and_fall_to_the_right():
    terrain = world_of("stairs", 2).terrain
    up, down, kerb = terrain.heights(np.array([12.0, 0.0, 0.0]), np.array([0.0, -9.0, 6.0]))
    assert up == pytest.approx(9 * 0.17, abs=0.03)
    assert down == pytest.approx(-9 * 0.17, abs=0.03)
    assert kerb == pytest.approx(0.12, abs=0.03)
