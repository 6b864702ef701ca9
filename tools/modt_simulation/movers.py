"""Animals, machines and vehicles that belong to no class, of random proportions."""

from __future__ import annotations

from dataclasses import dataclass

from numpy.random import Generator

from modt_simulation import kinds, vehicles
from modt_simulation.kinds import Kind
from modt_simulation.materials import Material
from modt_simulation.people import Posture
from modt_simulation.solids import Solids, Triple, box, cylinder, ellipsoid, rod

SIDES = (-1, 1)


@dataclass(frozen=True)
class Mover:
    """A body that drives, rolls or walks."""

    size: Triple  # length, width, height with its rider [m]
    speed_mps: float
    solids: Solids  # body frame
    kind: Kind = kinds.OTHER
    rider: Posture | None = None  # posture of who rides it, None for nobody
    pusher_m: float = 0.0  # distance of who pushes it behind its centre, 0 for nobody


def dog(rng: Generator) -> Mover:
    """A dog."""
    s = rng.uniform(0.6, 1.1)
    legs = [
        rod((x * s, y * s, 0.42 * s), (x * s + rng.uniform(-0.1, 0.1), y * s, 0.0), 0.03, Material.CLOTH)
        for x in (-0.25, 0.25)
        for y in (-0.07, 0.07)
    ]
    trunk = ellipsoid((0.0, 0.0, 0.45 * s), (0.36 * s, 0.12 * s, 0.14 * s), Material.CLOTH)
    head = ellipsoid((0.45 * s, 0.0, 0.56 * s), (0.14 * s, 0.08 * s, 0.09 * s), Material.CLOTH)
    return Mover((1.1 * s, 0.26 * s, 0.65 * s), 1.5, Solids.join([trunk, head, *legs]))


def robot(rng: Generator) -> Mover:
    """A small robot on four wheels."""
    tall = rng.uniform(0.25, 0.38)
    hull = box((0.0, 0.0, 0.1 + tall / 2), (0.7, 0.5, tall - 0.1), Material.CAR_PAINT)
    sensor = cylinder((0.2, 0.0, tall + 0.07), 0.05, 0.06, Material.METAL)
    return Mover((0.7, 0.54, tall + 0.1), 1.0, Solids.join([hull, sensor, *_wheels(0.22, 0.24, 0.1)]))


def ball(rng: Generator) -> Mover:
    """A football or a larger ball."""
    radius = rng.uniform(0.1, 0.14)
    return Mover((2 * radius,) * 3, 2.0, ellipsoid((0.0, 0.0, radius), (radius,) * 3, Material.CLOTH))


def wheelchair(rng: Generator) -> Mover:
    """A wheelchair with its user."""
    seat = box((-0.02, 0.0, 0.44), (0.45, 0.45, 0.06), Material.CLOTH)
    back = box((-0.24, 0.0, 0.7), (0.04, 0.42, 0.45), Material.CLOTH)
    radius = rng.uniform(0.27, 0.32)
    drive = [cylinder((-0.1, s * 0.28, radius), radius, 0.03, Material.RUBBER, axis=1) for s in SIDES]
    return Mover((1.0, 0.65, 1.33), 1.0, Solids.join([seat, back, *drive]), rider=Posture.SIT)


def pushchair(rng: Generator) -> Mover:
    """A pushchair."""
    tub = box((0.0, 0.0, 0.55), (0.6, 0.4, 0.3), Material.CLOTH)
    hood = ellipsoid((-0.1, 0.0, 0.8), (0.28, 0.2, rng.uniform(0.15, 0.25)), Material.CLOTH)
    handle = _handle(-0.62, 1.02, 0.2)
    return Mover((1.1, 0.5, 1.05), 1.1, Solids.join([tub, hood, *handle, *_wheels(0.3, 0.22, 0.12)]), pusher_m=0.95)


def trolley(rng: Generator) -> Mover:
    """A transport trolley with its load."""
    bed = box((0.0, 0.0, 0.17), (0.9, 0.6, 0.05), Material.METAL)
    tall = rng.uniform(0.3, 1.0)
    load = box((0.0, 0.0, 0.2 + tall / 2), (0.8, 0.55, tall), Material.WOOD)
    size = (1.0, 0.62, max(1.1, 0.2 + tall))
    handle = _handle(-0.48, 1.05, 0.25)
    return Mover(size, 1.1, Solids.join([bed, load, *handle, *_wheels(0.35, 0.24, 0.08)]), pusher_m=0.9)


def scooter(rng: Generator) -> Mover:
    """An e-scooter with its rider."""
    deck = box((0.0, 0.0, 0.12), (0.75, 0.16, 0.05), Material.RUBBER)
    bar = rod((0.4, -0.22, 1.1), (0.4, 0.22, 1.1), 0.02, Material.RUBBER)
    column = rod((0.45, 0.0, 0.1), (0.4, 0.0, 1.1), 0.025, Material.METAL)
    wheels = [cylinder((x, 0.0, 0.11), 0.11, 0.05, Material.RUBBER, axis=1) for x in (-0.5, 0.48)]
    parts = Solids.join([deck, bar, column, *wheels])
    return Mover((1.2, 0.6, 1.8), rng.uniform(3.0, 5.5), parts, rider=Posture.STAND)


def skateboard(rng: Generator) -> Mover:
    """A skateboard with its rider."""
    board = box((0.0, 0.0, 0.09), (0.8, 0.2, 0.02), Material.WOOD)
    return Mover((0.8, 0.6, 1.8), rng.uniform(2.0, 4.0), board, rider=Posture.STAND)


def forklift(rng: Generator) -> Mover:
    """A forklift truck with a load in front."""
    chassis = box((-0.3, 0.0, 0.6), (1.6, 1.1, 0.8), Material.CAR_PAINT)
    driver = ellipsoid((-0.3, 0.0, 1.35), (0.2, 0.25, 0.5), Material.CLOTH)
    roof = box((-0.2, 0.0, 2.12), (1.3, 1.05, 0.05), Material.METAL)
    load = box((1.2, 0.0, rng.uniform(0.4, 0.9)), (1.0, 0.9, 0.7), Material.WOOD)
    return Mover((3.4, 1.15, 2.15), 2.2, Solids.join([chassis, driver, roof, load]), kinds.FORKLIFT)


def bus(rng: Generator) -> Mover:
    """A bus, at times as long as an articulated one."""
    length = rng.uniform(9.0, 18.0)
    hull = box((0.0, 0.0, 1.7), (length, 2.55, 2.8), Material.CAR_PAINT)
    parts = Solids.join([hull, *_wheels(0.3 * length, 1.15, 0.48)])
    return Mover((length, 2.6, 3.1), rng.uniform(4.0, 7.0), parts, kinds.BUS)


def lorry(rng: Generator) -> Mover:
    """A lorry."""
    size = vehicles.truck_size(rng)
    return Mover(size, rng.uniform(4.0, 7.0), vehicles.truck(rng, size), kinds.TRUCK)


MAKERS = (dog, robot, ball, wheelchair, pushchair, trolley, scooter, skateboard, forklift, bus, lorry)
"""Makers of all movers."""


def _wheels(x: float, y: float, radius: float) -> list[Solids]:
    """Four wheels."""
    places = [(i * x, j * y, radius) for i in SIDES for j in SIDES]
    return [cylinder(place, radius, 0.06, Material.RUBBER, axis=1) for place in places]


def _handle(x: float, z: float, half_m: float) -> list[Solids]:
    """A handle that is reached from behind: two stays and the bar between them."""
    stays = [rod((-0.2, s * half_m, 0.4), (x, s * half_m, z), 0.018, Material.METAL) for s in SIDES]
    return [*stays, rod((x, -half_m, z), (x, half_m, z), 0.018, Material.METAL)]
