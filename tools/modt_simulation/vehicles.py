"""Cars, vans, trucks, bicycles and motor scooters of random proportions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from modt.geometry import rotation_zyx
from modt_simulation.materials import Material
from modt_simulation.solids import Solids, Triple, box, cylinder, rod, rounded, wedge

CLEARANCE_M = 0.07
"""Gap between the roof of a car and the top of its annotated box."""
LEAN = 0.1
"""Inward slope of the sides of a van [m/m]."""
PLATE_M = (0.52, 0.11)
"""Width and height of a number plate."""
INSET_M = 0.03
"""Depth of the centres of plates and lamps below the surface, for which the width of the beam makes up."""


def car(rng: Generator, size: Triple) -> Solids:
    """A hatchback, saloon or estate car of (length, width, height)."""
    length, width = size[:2]
    height = size[2] - CLEARANCE_M
    clear = rng.uniform(0.17, 0.24)
    belt = height * rng.uniform(0.58, 0.64)
    paint = (Material.CAR_PAINT, Material.CAR_DARK, Material.CAR_BLACK)[rng.choice(3, p=[0.5, 0.28, 0.22])]
    nose = belt - rng.uniform(0.12, 0.25)
    bonnet = rng.uniform(0.24, 0.3) * length
    boot = rng.choice([0.03, 0.1, 0.2], p=[0.6, 0.15, 0.25]) * length
    hull = _car_hull(rng, (length, width, belt - clear), clear, belt - nose, bonnet, paint)
    cabin = _Cabin(length / 2 - bonnet + 0.1, -length / 2 + boot, belt, height, width, paint)
    cabin.rake = rng.uniform(0.65, 1.05)
    cabin.tail = rng.uniform(0.15, 0.6)
    cabin.tuck = rng.uniform(0.28, 0.45)
    glasshouse = _glasshouse(rng, cabin)
    seats = _seats(cabin.front - cabin.rake, cabin.rear + cabin.tail, belt, width)
    pillars = _pillars(rng, cabin)
    wheels = _wheels(rng, length, width, rng.uniform(0.3, 0.34))
    mirrors = _mirrors(cabin.front, cabin)
    return Solids.join(
        [hull, *glasshouse, seats, pillars, wheels, mirrors, *_reflectors(hull, 0.43, belt - 0.16, belt - 0.12)]
    )


def open_door(rng: Generator, size: Triple) -> Solids:
    """The open front door on the left of a car of (length, width, height)."""
    leaf = box((0.48, 0.0, 0.68), (0.95, 0.06, 0.7), Material.CAR_PAINT)
    window = box((0.5, 0.0, 1.2), (0.8, 0.03, 0.34), Material.GLASS)
    turn = rotation_zyx(0.0, 0.0, np.pi - rng.uniform(1.05, 1.3))
    return Solids.join([leaf, window]).transformed(turn, np.array([0.75, size[1] / 2, 0.0]))


@dataclass
class _Cabin:
    """The part of a vehicle above its belt line."""

    front: float  # lower end of the windscreen along x [m]
    rear: float  # lower end of the rear window along x [m]
    belt: float  # height of the lower edge of the windows [m]
    height: float  # height of the roof [m]
    width: float  # width of the vehicle [m]
    paint: int  # Material of the vehicle
    rake: float = 0.0  # distance by which the windscreen leans back [m]
    tail: float = 0.05  # distance by which the rear window leans forward [m]
    tuck: float = LEAN  # inward slope of the sides [m/m]


def _car_hull(rng: Generator, size: Triple, clear: float, drop: float, bonnet: float, paint: int) -> Solids:
    """The body of a car below its windows, whose bonnet falls by a drop; the bumpers are rounded."""
    length, width, height = size
    bumper = length / 2 + 0.35 * height * 0.2
    hood = (drop, 0.0, bonnet, drop * (length / 2 - bonnet) + bonnet * height / 2)
    cuts = [hood, (1.0, 0.0, -0.35, bumper), (-1.0, 0.0, -0.35, bumper)]
    hull = wedge((0.0, 0.0, clear + height / 2), (length, 0.97 * width, height), paint, cuts)
    return rounded(hull, (0.515 * length, width * rng.uniform(0.95, 1.6), height * rng.uniform(1.4, 2.4)))


def _glasshouse(rng: Generator, cabin: _Cabin) -> tuple[Solids, Solids]:
    """The windows of a car, and its roof."""
    width = cabin.width
    length = cabin.front - cabin.rear
    height = cabin.height - cabin.belt + 0.02
    half = height / 2
    cuts = [
        (height, 0.0, cabin.rake, height * length / 2 - cabin.rake * half),
        (-height, 0.0, cabin.tail, height * length / 2 - cabin.tail * half),
        *((0.0, side, cabin.tuck, 0.47 * width - cabin.tuck * half) for side in (1.0, -1.0)),
    ]
    centre = ((cabin.front + cabin.rear) / 2, 0.0, cabin.belt + half - 0.02)
    glass = wedge(centre, (length, 0.94 * width, height), Material.GLASS, cuts)
    glass = rounded(glass, (length * 0.52, width * rng.uniform(0.95, 1.6), np.inf))
    glass.density[:] = rng.uniform(0.6, 2.0)
    lid_length = max(length - cabin.rake - cabin.tail, 0.5)
    size = (lid_length + 0.15, 0.94 * width - 2 * cabin.tuck * height + 0.04, 0.1)
    middle = (cabin.front - cabin.rake + cabin.rear + cabin.tail) / 2
    lid = box((middle, 0.0, cabin.height - 0.05), size, cabin.paint)
    return glass, rounded(lid, (lid_length * 0.62 + 0.1, 0.62 * width, 0.11))


def van(rng: Generator, size: Triple) -> Solids:
    """A delivery van or a minibus of (length, width, height)."""
    length, width, height = size
    clear = rng.uniform(0.2, 0.3)
    belt = height * rng.uniform(0.46, 0.55)
    paint = Material.CAR_PAINT if rng.random() < 0.8 else Material.CAR_DARK
    low = belt - clear
    bonnet = rng.uniform(0.04, 0.19) * length
    rake = rng.uniform(0.4, 0.9)
    drop = rng.uniform(0.1, 0.3)
    roof = rng.uniform(0.12, 0.2)
    hood = (drop, 0.0, bonnet, drop * (length / 2 - bonnet) + bonnet * low / 2)
    hull = wedge((0.0, 0.0, clear + low / 2), (length, 0.97 * width, low), paint, [hood])
    hull = rounded(hull, (0.515 * length, width * rng.uniform(1.2, 2.2), np.inf))
    cabin = _Cabin(length / 2 - bonnet, -length / 2 + rng.uniform(0.02, 0.2), belt, height, width, paint, rake)
    windows = _van_windows(rng, cabin)
    middle = (cabin.front - rake + cabin.rear) / 2
    lid = box((middle, 0.0, height - roof / 2), (cabin.front - rake - cabin.rear, 0.9 * width, roof), paint)
    seats = _seats(cabin.front - 0.7 * rake, cabin.rear + 0.3, belt, width)
    pillars = _pillars(rng, cabin)
    wheels = _wheels(rng, length, width, 0.34)
    mirrors = _mirrors(cabin.front - 0.3, cabin)
    return Solids.join(
        [hull, *windows, lid, seats, pillars, wheels, mirrors, *_reflectors(hull, 0.45, 0.8, belt - 0.15)]
    )


def _van_windows(rng: Generator, cabin: _Cabin) -> tuple[Solids, Solids]:
    """The glazed cab of a van, and its load space, which is glazed in a minibus."""
    width = cabin.width
    height = cabin.height - cabin.belt
    length = cabin.rake + rng.uniform(0.9, 1.3)
    leaning = [(0.0, side, LEAN, 0.485 * width) for side in (1.0, -1.0)]
    cuts = [(height, 0.0, cabin.rake, height * (length / 2 - cabin.rake / 2)), *leaning]
    middle_z = cabin.belt + height / 2
    cab = wedge((cabin.front - length / 2, 0.0, middle_z), (length, 0.95 * width, height), Material.GLASS, cuts)
    centre = ((cabin.front - length + cabin.rear) / 2, 0.0, middle_z)
    size = (cabin.front - length - cabin.rear, 0.97 * width, height)
    load = wedge(centre, size, Material.GLASS if rng.random() < 0.4 else cabin.paint, leaning)
    for window in (cab, load):
        if window.material[0] == Material.GLASS:
            window.density[:] = rng.uniform(0.6, 2.0)
    return cab, load


def truck(rng: Generator, size: Triple) -> Solids:
    """A lorry of (length, width, height): cab, box and wheels."""
    length, width, height = size
    cab = rng.uniform(1.7, 2.2)
    cab_height = min(height, rng.uniform(2.5, 3.0))
    load = length - cab - 0.4
    centre = (length / 2 - cab / 2, 0.0, 0.5 + (cab_height - 0.5) / 2)
    parts = [
        wedge(centre, (cab, 0.96 * width, cab_height - 0.5), Material.CAR_PAINT, [(1.0, 0.0, 0.15, cab / 2)]),
        box((-length / 2 + load / 2, 0.0, 1.0 + (height - 1.0) / 2), (load, width, height - 1.0), Material.CAR_PAINT),
        box((-0.2, 0.0, 0.8), (0.9 * length, 0.8, 0.3), Material.METAL),
    ]
    return Solids.join([*parts, _wheels(rng, length, width, 0.48)])


def bicycle(rng: Generator) -> Solids:
    """A bicycle; x ahead, origin on the ground between the wheels."""
    radius = 0.34
    base = rng.uniform(0.98, 1.08)
    rear = (-base / 2, 0.0, radius)
    front = (base / 2, 0.0, radius)
    wheels = [cylinder(hub, radius, 0.04, Material.METAL, axis=1) for hub in (rear, front)]
    for wheel in wheels:
        wheel.density[:] = 9.0  # spokes
    seat = (-0.22, 0.0, 0.9)
    head = (0.36, 0.0, 0.92)
    crank = (0.02, 0.0, 0.3)
    top = (-0.15, 0.0, 0.75)
    tubes = [(crank, seat), (crank, head), (top, head), (rear, crank), (rear, top), (head, front)]
    parts = wheels + [rod(a, b, 0.025, Material.METAL) for a, b in tubes]
    parts.append(rod((0.4, -0.28, 1.0), (0.4, 0.28, 1.0), 0.025, Material.RUBBER))
    parts.append(box((-0.24, 0.0, 0.93), (0.25, 0.15, 0.07), Material.RUBBER))
    if rng.random() < 0.35:
        parts.append(box((-0.5, 0.0, 0.82), (0.38, 0.35, 0.3), Material.RUBBER))
    parts.append(box((-base / 2 - 0.3, 0.0, 0.6), (0.02, 0.05, 0.05), Material.LAMP))
    return Solids.join(parts)


def motor_scooter(rng: Generator) -> Solids:
    """A motor scooter; x ahead, origin on the ground between the wheels."""
    radius = rng.uniform(0.2, 0.27)
    base = rng.uniform(1.15, 1.32)
    wide = rng.uniform(0.26, 0.4)
    seat = rng.uniform(0.72, 0.82)
    head = rng.uniform(0.95, 1.1)
    paint = (Material.CAR_PAINT, Material.CAR_DARK, Material.CAR_BLACK)[rng.integers(3)]
    wheels = [cylinder((s * base / 2, 0.0, radius), radius, 0.1, Material.RUBBER, axis=1) for s in (-1, 1)]
    parts = [
        *wheels,
        box((-0.42, 0.0, (seat + 0.25) / 2 + 0.05), (0.75, wide, seat - 0.25), paint),
        box((-0.38, 0.0, seat + 0.04), (0.7, 0.28, 0.1), Material.RUBBER),
        box((0.1, 0.0, 0.28), (0.45, wide, 0.1), paint),
        box((0.42, 0.0, 0.6), (0.12, wide + 0.05, 0.65), paint, rng.uniform(-0.05, 0.05)),
        rod((base / 2, 0.0, radius), (0.42, 0.0, head - 0.05), 0.05, Material.METAL),
        box((0.46, 0.0, head - 0.05), (0.2, 0.24, 0.22), paint),
        rod((0.38, -0.33, head), (0.38, 0.33, head), 0.025, Material.RUBBER),
    ]
    if rng.random() < 0.7:
        parts += [box((0.4, side * 0.36, head + 0.17), (0.03, 0.12, 0.09), Material.METAL) for side in (-1, 1)]
    if rng.random() < 0.3:
        parts.append(box((-0.85, 0.0, seat + 0.22), (0.32, 0.36, 0.3), Material.RUBBER))
    parts.append(box((-0.82, 0.0, 0.55), (0.02, 0.16, 0.12), Material.RETRO))
    return Solids.join(parts)


def _end(hull: Solids, y: float, z: float, side: float) -> float:
    """Coordinate x of the surface of a hull ahead of (1) or behind (-1) a point inside it."""
    _, dy, dz = np.array([0.0, y, z]) - hull.centre[0]
    quadric = hull.quadric[0]
    # along x, the nearest of the surfaces that bound the hull: box, quadric and cutting planes
    reach = [hull.half[0, 0], np.sqrt(max(1 - quadric[1] * dy**2 - quadric[2] * dz**2, 0.0) / max(quadric[0], 1e-9))]
    reach += [(d - b * dy - c * dz) / abs(a) for a, b, c, d in hull.cuts[0] if a * side > 0]
    return float(hull.centre[0, 0] + side * min(reach))


def _reflectors(hull: Solids, front_z: float, rear_z: float, lamp_z: float) -> list[Solids]:
    """Retroreflective number plates at two heights, and the reflectors of the tail lamps."""
    y = 0.8 * float(hull.half[0, 1])
    return [
        *(
            box((_end(hull, 0.0, z, side) - side * INSET_M, 0.0, z), (0.02, *PLATE_M), Material.RETRO)
            for z, side in ((front_z, 1.0), (rear_z, -1.0))
        ),
        *(
            box((_end(hull, side * y, lamp_z, -1.0) + INSET_M, side * y, lamp_z), (0.02, 0.12, 0.14), Material.LAMP)
            for side in (-1.0, 1.0)
        ),
    ]


def car_size(rng: Generator) -> Triple:
    """A random size of a car, as KITTI's object labels are distributed: 3.9 by 1.63 by 1.53 m, correlated."""
    scale = rng.normal()
    return (
        min(max(3.9 + 0.38 * scale + 0.15 * rng.normal(), 3.0), 5.0),
        min(max(1.63 + 0.06 * scale + 0.06 * rng.normal(), 1.42), 1.9),
        min(max(1.51 + 0.02 * scale + 0.1 * rng.normal(), 1.3), 1.9),
    )


def van_size(rng: Generator) -> Triple:
    """A random size of a van, about 5.1 by 1.9 by 2.2 m."""
    scale = rng.normal()
    return (
        min(max(5.0 + 0.6 * scale, 4.0), 7.0),
        min(max(1.9 + 0.08 * scale + 0.08 * rng.normal(), 1.65), 2.2),
        min(max(2.15 + 0.2 * scale + 0.15 * rng.normal(), 1.75), 2.8),
    )


def truck_size(rng: Generator) -> Triple:
    """A random size of a lorry, about 9 by 2.6 by 3.3 m."""
    return rng.uniform(6.5, 12.0), rng.uniform(2.3, 2.7), rng.uniform(2.8, 3.8)


def _wheels(rng: Generator, length: float, width: float, radius: float) -> Solids:
    x = length * rng.uniform(0.29, 0.32)
    places = [(i * x, j * (width / 2 - 0.1), radius) for i in (-1, 1) for j in (-1, 1)]
    return Solids.join(cylinder(place, radius, 0.22, Material.RUBBER, axis=1) for place in places)


def _mirrors(x: float, cabin: _Cabin) -> Solids:
    places = [(x - 0.35, side * (cabin.width / 2 + 0.05), cabin.belt + 0.05) for side in (-1, 1)]
    return Solids.join(box(place, (0.12, 0.16, 0.14), cabin.paint) for place in places)


def _seats(front: float, rear: float, belt: float, width: float) -> Solids:
    """Backrests and a dashboard, visible through the windows."""
    rows = [front - 0.75, max(front - 1.7, rear + 0.1)]
    backs = [box((x, s * 0.22 * width, belt), (0.14, 0.45, 0.7), Material.INTERIOR) for x in rows for s in (-1, 1)]
    return Solids.join([*backs, box((front + 0.15, 0.0, belt - 0.02), (0.4, 0.8 * width, 0.16), Material.INTERIOR)])


def _pillars(rng: Generator, cabin: _Cabin) -> Solids:
    """Painted pillars beside the windscreen, between the doors and at the rear."""
    bottom = 0.46 * cabin.width
    top = bottom - cabin.tuck * (cabin.height - cabin.belt)
    roof_front = cabin.front - cabin.rake
    roof_rear = cabin.rear + cabin.tail
    middle = (cabin.front - cabin.rake + cabin.rear + cabin.tail) / 2 + rng.uniform(-0.2, 0.2)
    # x of the lower and the upper end, and radius
    places = [
        (cabin.front - 0.1, roof_front, 0.035),
        (middle, middle, 0.045),
        (cabin.rear + 0.15, roof_rear, 0.1),
    ]
    return Solids.join(
        rod((low, side * bottom, cabin.belt), (high, side * top, cabin.height - 0.05), radius, cabin.paint)
        for side in (-1, 1)
        for low, high, radius in places
    )
