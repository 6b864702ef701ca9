"""Cars, vans, trucks and bicycles of random proportions."""

from __future__ import annotations

import numpy as np

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


def car(rng: np.random.Generator, size: Triple) -> Solids:
    """A hatchback, saloon or estate car of (length, width, height)."""
    length, width = size[:2]
    height = size[2] - CLEARANCE_M
    clear, belt = rng.uniform(0.17, 0.24), height * rng.uniform(0.58, 0.64)
    paint = (Material.CAR_PAINT, Material.CAR_DARK, Material.CAR_BLACK)[rng.choice(3, p=[0.5, 0.28, 0.22])]
    nose = belt - rng.uniform(0.12, 0.25)
    bonnet = rng.uniform(0.24, 0.3) * length
    boot = rng.choice([0.03, 0.1, 0.2], p=[0.6, 0.15, 0.25]) * length
    body_height = belt - clear
    middle = clear + body_height / 2
    bumper = length / 2 + 0.35 * body_height * 0.2
    hood = (belt - nose, 0.0, bonnet, (belt - nose) * (length / 2 - bonnet) + bonnet * body_height / 2)
    cuts = [hood, (1.0, 0.0, -0.35, bumper), (-1.0, 0.0, -0.35, bumper)]
    hull = wedge((0.0, 0.0, middle), (length, 0.97 * width, body_height), paint, cuts)
    hull = rounded(hull, (0.515 * length, width * rng.uniform(0.95, 1.6), body_height * rng.uniform(1.4, 2.4)))
    front, rear = length / 2 - bonnet + 0.1, -length / 2 + boot
    cabin_height = height - belt + 0.02
    half = cabin_height / 2
    rake, tail, tuck = rng.uniform(0.65, 1.05), rng.uniform(0.15, 0.6), rng.uniform(0.28, 0.45)
    long = front - rear
    cuts = [
        (cabin_height, 0.0, rake, cabin_height * long / 2 - rake * half),
        (-cabin_height, 0.0, tail, cabin_height * long / 2 - tail * half),
        *((0.0, side, tuck, 0.47 * width - tuck * half) for side in (1.0, -1.0)),
    ]
    centre = ((front + rear) / 2, 0.0, belt + half - 0.02)
    glass = wedge(centre, (long, 0.94 * width, cabin_height), Material.GLASS, cuts)
    glass = rounded(glass, (long * 0.52, width * rng.uniform(0.95, 1.6), np.inf))
    glass.density[:] = rng.uniform(0.6, 2.0)
    lid_length = max(long - rake - tail, 0.5)
    size = (lid_length + 0.15, 0.94 * width - 2 * tuck * cabin_height + 0.04, 0.1)
    lid = box(((front - rake + rear + tail) / 2, 0.0, height - 0.05), size, paint)
    lid = rounded(lid, (lid_length * 0.62 + 0.1, 0.62 * width, 0.11))
    seats = _seats(front - rake, rear + tail, belt, width)
    pillars = _pillars(rng, (front, rear, rake, tail), (belt, height), width, tuck, paint)
    wheels = _wheels(rng, length, width, rng.uniform(0.3, 0.34))
    reflectors = [_plates(hull, 0.43, belt - 0.16), _tail_lamps(hull, belt - 0.12)]
    return Solids.join([hull, glass, lid, seats, pillars, wheels, _mirrors(front, belt, width, paint), *reflectors])


def van(rng: np.random.Generator, size: Triple) -> Solids:
    """A delivery van or a minibus of (length, width, height)."""
    length, width, height = size
    clear, belt = rng.uniform(0.2, 0.3), height * rng.uniform(0.46, 0.55)
    paint = Material.CAR_PAINT if rng.random() < 0.8 else Material.CAR_DARK
    low, upper = belt - clear, height - belt
    bonnet, rake = rng.uniform(0.04, 0.19) * length, rng.uniform(0.4, 0.9)
    drop, roof = rng.uniform(0.1, 0.3), rng.uniform(0.12, 0.2)
    hood = (drop, 0.0, bonnet, drop * (length / 2 - bonnet) + bonnet * low / 2)
    hull = wedge((0.0, 0.0, clear + low / 2), (length, 0.97 * width, low), paint, [hood])
    hull = rounded(hull, (0.515 * length, width * rng.uniform(1.2, 2.2), np.inf))
    front, rear = length / 2 - bonnet, -length / 2 + rng.uniform(0.02, 0.2)
    cab = rake + rng.uniform(0.9, 1.3)
    leaning = [(0.0, side, LEAN, 0.485 * width) for side in (1.0, -1.0)]
    cuts = [(upper, 0.0, rake, upper * (cab / 2 - rake / 2)), *leaning]
    glass = wedge((front - cab / 2, 0.0, belt + upper / 2), (cab, 0.95 * width, upper), Material.GLASS, cuts)
    centre, size = ((front - cab + rear) / 2, 0.0, belt + upper / 2), (front - cab - rear, 0.97 * width, upper)
    load = wedge(centre, size, Material.GLASS if rng.random() < 0.4 else paint, leaning)
    for window in (glass, load):
        if window.material[0] == Material.GLASS:
            window.density[:] = rng.uniform(0.6, 2.0)
    lid = box(((front - rake + rear) / 2, 0.0, height - roof / 2), (front - rake - rear, 0.9 * width, roof), paint)
    seats = _seats(front - 0.7 * rake, rear + 0.3, belt, width)
    pillars = _pillars(rng, (front, rear, rake, 0.05), (belt, height), width, LEAN, paint)
    trim = [_wheels(rng, length, width, 0.34), _mirrors(front - 0.3, belt, width, paint)]
    reflectors = [_plates(hull, 0.45, 0.8), _tail_lamps(hull, belt - 0.15)]
    return Solids.join([hull, glass, load, lid, seats, pillars, *trim, *reflectors])


def truck(rng: np.random.Generator, size: Triple) -> Solids:
    """A lorry of (length, width, height): cab, box and wheels."""
    length, width, height = size
    cab = rng.uniform(1.7, 2.2)
    cab_height = min(height, rng.uniform(2.5, 3.0))
    load = length - cab - 0.4
    centre, size = (length / 2 - cab / 2, 0.0, 0.5 + (cab_height - 0.5) / 2), (cab, 0.96 * width, cab_height - 0.5)
    parts = [
        wedge(centre, size, Material.CAR_PAINT, [(1.0, 0.0, 0.15, cab / 2)]),
        box((-length / 2 + load / 2, 0.0, 1.0 + (height - 1.0) / 2), (load, width, height - 1.0), Material.CAR_PAINT),
        box((-0.2, 0.0, 0.8), (0.9 * length, 0.8, 0.3), Material.METAL),
    ]
    return Solids.join([*parts, _wheels(rng, length, width, 0.48)])


def bicycle(rng: np.random.Generator) -> Solids:
    """A bicycle; x ahead, origin on the ground between the wheels."""
    radius, base = 0.34, rng.uniform(0.98, 1.08)
    parts = []
    for x in (-base / 2, base / 2):
        parts.append(cylinder((x, 0.0, radius), radius, 0.04, Material.METAL, axis=1))
        parts[-1].density[:] = 9.0  # spokes
    seat, head, crank = (-0.22, 0.0, 0.9), (0.36, 0.0, 0.92), (0.02, 0.0, 0.3)
    rear, front = (-base / 2, 0.0, radius), (base / 2, 0.0, radius)
    top = (-0.15, 0.0, 0.75)
    tubes = [(crank, seat), (crank, head), (top, head), (rear, crank), (rear, top), (head, front)]
    parts += [rod(a, b, 0.025, Material.METAL) for a, b in tubes]
    parts.append(rod((0.4, -0.28, 1.0), (0.4, 0.28, 1.0), 0.025, Material.RUBBER))
    parts.append(box((-0.24, 0.0, 0.93), (0.25, 0.15, 0.07), Material.RUBBER))
    if rng.random() < 0.35:
        parts.append(box((-0.5, 0.0, 0.82), (0.38, 0.35, 0.3), Material.RUBBER))
    parts.append(box((-base / 2 - 0.3, 0.0, 0.6), (0.02, 0.05, 0.05), Material.LAMP))
    return Solids.join(parts)


def _end(hull: Solids, y: float, z: float, side: float) -> float:
    """Coordinate x of the surface of a hull ahead of (1) or behind (-1) a point inside it."""
    _, dy, dz = np.array([0.0, y, z]) - hull.centre[0]
    half, quadric, cuts = hull.half[0], hull.quadric[0], hull.cuts[0]
    reach = [half[0], np.sqrt(max(1 - quadric[1] * dy**2 - quadric[2] * dz**2, 0.0) / max(quadric[0], 1e-9))]
    reach += [(d - b * dy - c * dz) / abs(a) for a, b, c, d in cuts if a * side > 0]
    return float(hull.centre[0, 0] + side * min(reach))


def _plates(hull: Solids, front_z: float, rear_z: float) -> Solids:
    """Retroreflective number plates."""
    return Solids.join(
        box((_end(hull, 0.0, z, side) - side * INSET_M, 0.0, z), (0.02, *PLATE_M), Material.RETRO)
        for z, side in ((front_z, 1.0), (rear_z, -1.0))
    )


def _tail_lamps(hull: Solids, z: float) -> Solids:
    """Reflectors of the tail lamps."""
    y = 0.8 * float(hull.half[0, 1])
    return Solids.join(
        box((_end(hull, s * y, z, -1.0) + INSET_M, s * y, z), (0.02, 0.12, 0.14), Material.LAMP) for s in (-1.0, 1.0)
    )


def car_size(rng: np.random.Generator) -> Triple:
    """A random size of a car, as KITTI's object labels are distributed: 3.9 by 1.63 by 1.53 m, correlated."""
    scale = rng.normal(0.0, 1.0)
    return (
        float(np.clip(3.9 + 0.38 * scale + 0.15 * rng.normal(), 3.0, 5.0)),
        float(np.clip(1.63 + 0.06 * scale + 0.06 * rng.normal(), 1.42, 1.9)),
        float(np.clip(1.51 + 0.02 * scale + 0.1 * rng.normal(), 1.3, 1.9)),
    )


def van_size(rng: np.random.Generator) -> Triple:
    """A random size of a van, about 5.1 by 1.9 by 2.2 m."""
    scale = rng.normal(0.0, 1.0)
    return (
        float(np.clip(5.0 + 0.6 * scale, 4.0, 7.0)),
        float(np.clip(1.9 + 0.08 * scale + 0.08 * rng.normal(), 1.65, 2.2)),
        float(np.clip(2.15 + 0.2 * scale + 0.15 * rng.normal(), 1.75, 2.8)),
    )


def truck_size(rng: np.random.Generator) -> Triple:
    """A random size of a lorry, about 9 by 2.6 by 3.3 m."""
    return float(rng.uniform(6.5, 12.0)), float(rng.uniform(2.3, 2.7)), float(rng.uniform(2.8, 3.8))


def _wheels(rng: np.random.Generator, length: float, width: float, radius: float) -> Solids:
    x = length * rng.uniform(0.29, 0.32)
    places = [(i * x, j * (width / 2 - 0.1), radius) for i in (-1, 1) for j in (-1, 1)]
    return Solids.join(cylinder(place, radius, 0.22, Material.RUBBER, axis=1) for place in places)


def _mirrors(x: float, z: float, width: float, paint: int) -> Solids:
    return Solids.join(box((x - 0.35, s * (width / 2 + 0.05), z + 0.05), (0.12, 0.16, 0.14), paint) for s in (-1, 1))


def _seats(front: float, rear: float, belt: float, width: float) -> Solids:
    """Backrests and a dashboard, visible through the windows."""
    rows = [front - 0.75, max(front - 1.7, rear + 0.1)]
    backs = [box((x, s * 0.22 * width, belt), (0.14, 0.45, 0.7), Material.INTERIOR) for x in rows for s in (-1, 1)]
    return Solids.join([*backs, box((front + 0.15, 0.0, belt - 0.02), (0.4, 0.8 * width, 0.16), Material.INTERIOR)])


def _pillars(
    rng: np.random.Generator, ends: tuple[float, ...], rise: tuple[float, ...], width: float, tuck: float, paint: int
) -> Solids:
    """Painted pillars beside the windscreen, between the doors and at the rear."""
    front, rear, rake, tail = ends
    belt, height = rise
    bottom, top = 0.46 * width, 0.46 * width - tuck * (height - belt)
    middle = (front - rake + rear + tail) / 2 + rng.uniform(-0.2, 0.2)
    places = [(front - 0.1, front - rake), (middle, middle), (rear + 0.15, rear + tail)]
    return Solids.join(
        rod((a, s * bottom, belt), (b, s * top, height - 0.05), r, paint)
        for s in (-1, 1)
        for (a, b), r in zip(places, (0.035, 0.045, 0.1), strict=True)
    )
