"""Scenes in which obstacles are easily lost hold the people, movers and ceilings that they are made for."""

from collections import defaultdict

import numpy as np
import pytest

from modt.classes import ObjectClass
from modt_simulation.covers import COVERS, PLATFORMS_M, hanging
from modt_simulation.movers import MAKERS
from modt_simulation.obstacles import GAPS_M
from modt_simulation.postures import NEAR_M, RINGS_M, people
from modt_simulation.synthetic_stream import SyntheticStream
from tests.modt_simulation.test_stream import heights_of


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
    assert (roles.count("between cars"), roles.count("in a queue")) == (3, 4)
    assert sum(role.endswith("door") for role in roles) == 1


@pytest.mark.parametrize("seed", range(8))
def test_the_doorway_is_as_wide_as_it_is_said_to_be_and_ends_before_the_cars(seed):
    world = world_of("wall", seed)
    boxes = world.boxes(0.0)
    (role,) = (body.role for body in world.bodies if "doorway" in body.role)
    jambs = boxes[[not body.kind.name and body.size[1] == 1.0 for body in world.bodies]]
    np.testing.assert_allclose(2 * np.abs(jambs[:, 1]) - 1.0, float(role.split()[-2]))
    at_door = boxes[[body.role.endswith("door") for body in world.bodies]]
    assert np.abs(at_door[:, 1]) - 0.3 > np.abs(jambs[:, 1]).max() + 0.5


def test_who_stands_at_an_open_door_is_between_it_and_the_car():
    opened = 0
    for seed in range(12):
        world = world_of("wall", seed)
        for body in world.bodies:
            if body.role == "at a car's open door":
                opened += 1
                car = max((b for b in world.bodies if b.kind.name == "Car"), key=lambda b: b.path.at(0.0)[0])
                leaf = car.solids.centre[-2]
                ahead, left, _ = np.subtract(body.path.at(0.0), car.path.at(0.0))
                assert 0.2 < leaf[0] - ahead < 0.8
                assert car.size[1] / 2 < left < leaf[1] + 0.1
    assert 2 < opened < 10


@pytest.mark.parametrize("seed", range(3))
def test_the_ceiling_of_the_car_park_is_low(seed):
    frame, truth = SyntheticStream("carpark", "os1-64", 0.1, seed, height_m=0.5).simulator.sweep(0)
    z = heights_of(frame)
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


@pytest.mark.slow
def test_people_in_postures_are_on_the_rings_and_as_tall_as_they_are_said_to_be():
    tops = defaultdict(list)
    for seed in range(14):
        stream = SyntheticStream("postures", "os1-32", 0.1, seed)
        frame, truth = stream.simulator.sweep(0)
        z = heights_of(frame)
        world = stream.simulator.world
        for body, n in zip(truth.bodies.tolist(), truth.points.tolist(), strict=True):
            role = world.bodies[body].role
            distance_m = np.hypot(*world.bodies[body].path.at(0.0)[:2])
            rings_m = (NEAR_M,) if role == "at arm's length" else RINGS_M
            assert np.abs(np.subtract(rings_m, distance_m)).min() < 1e-9
            if n > 40:
                tops[role].append(z[truth.instance == body].max())
    assert set(tops) == {*people(np.random.default_rng(0)), "at arm's length"}
    assert np.max(tops["lies"]) < 0.5
    assert 0.7 < np.median(tops["crouches"]) < np.median(tops["kneels"]) < 1.5 < np.median(tops["stands"])


@pytest.mark.parametrize("seed", range(4))
def test_who_is_hidden_stands_or_walks_right_behind_the_cover(seed):
    world = world_of("hidden", seed)
    places = [np.array(body.path.at(2.0)[:2]) for body in world.bodies if not body.kind.name]
    people = [body for body in world.bodies if body.role]
    assert people
    for person in people:
        cover = COVERS[person.role.removeprefix("behind a ")]
        place = np.array(person.path.at(2.0)[:2])  # half way along a walk, in the middle behind the cover
        nearest = min(places, key=lambda other: np.hypot(*(place - other)))
        behind_m = np.hypot(*place) - np.hypot(*nearest)
        assert behind_m == pytest.approx(np.hypot(*(place - nearest)))
        assert 0.35 <= behind_m - cover.depth_m / 2 <= 1.2


def test_people_on_a_platform_are_as_high_as_it_is_said_to_be():
    heights_m = set()
    for seed in range(16):
        world = world_of("platform", seed)
        people = [body for body in world.bodies if body.role]
        (role,) = {body.role for body in people}
        at = np.array([body.path.at(0.0)[:2] for body in people])
        height_m = float(role.split()[-2])
        assert world.terrain.heights(*at.T) == pytest.approx(height_m, abs=0.04)
        assert world.terrain.heights(np.zeros(1), np.zeros(1)) == pytest.approx(0.0, abs=0.04)
        heights_m.add(height_m)
    assert len(heights_m) > 3
    assert heights_m <= set(PLATFORMS_M)


@pytest.mark.parametrize("seed", range(3))
def test_what_hangs_is_above_people_and_held_beside_them(seed):
    for name, solids in hanging(np.random.default_rng(seed)).items():
        reach_m = (np.abs(solids.rotation) @ solids.half[:, :, None])[:, :, 0]
        above_person = (np.abs(solids.centre[:, :2]) - reach_m[:, :2]).max(axis=1) < 0.0
        bottom_m = (solids.centre - reach_m)[:, 2]
        assert above_person.any(), name
        assert bottom_m[above_person].min() > 1.9


def test_stairs_rise_ahead_and_fall_to_the_right():
    terrain = world_of("stairs", 2).terrain
    up, down, kerb = terrain.heights(np.array([12.0, 0.0, 0.0]), np.array([0.0, -9.0, 6.0]))
    assert up == pytest.approx(9 * 0.17, abs=0.03)
    assert down == pytest.approx(-9 * 0.17, abs=0.03)
    assert kerb == pytest.approx(0.12, abs=0.03)
