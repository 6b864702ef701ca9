"""Builder of a scene: collects bodies and makes the world of those that do not collide."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from modt.geometry import corners
from modt.types import Bool, Float64, Int
from modt_simulation import kinds, vehicles
from modt_simulation.kinds import Kind
from modt_simulation.materials import Material
from modt_simulation.motion import Path
from modt_simulation.people import PERSON, Person, Posture
from modt_simulation.solids import Pair, Solids, Triple, box
from modt_simulation.terrain import Terrain
from modt_simulation.world import Body, World


def clipped_normal(rng: Generator, mean: float, sigma: float, low: float, high: float) -> float:
    """A normally distributed number, limited to a range."""
    return min(max(rng.normal(mean, sigma), low), high)


STEP_S = 0.25
"""Interval at which moving bodies are tested for collisions [s]."""
MARGIN_M = 0.1
"""Margin around each body."""


def without_collisions(paths: Sequence[Path], footprint: Float64, seconds: float, margin_m: float = MARGIN_M) -> Bool:
    """(n,) whether each body stays, by its path and its footprint (n, 2) [m].

    Of two that collide, the first one stays. Bodies of zero footprint do not collide. Pairs at rest are tested once.
    A negative margin lets bodies touch.
    """
    solid = footprint.min(axis=1) > 0
    kept = solid.copy()
    boxes = np.zeros((len(paths), 7))
    boxes[:, 3:5] = footprint + 2 * margin_m
    boxes[:, [0, 1, 6]] = [path.at(0.0) for path in paths]
    moving = np.array([not path.at_rest for path in paths])
    for step in range(int(seconds / STEP_S) + 2):
        for row in np.flatnonzero(moving & kept).tolist():
            boxes[row, [0, 1, 6]] = paths[row].at(step * STEP_S)
        tested = kept & moving if step else kept
        pairs = _close_pairs(boxes, np.flatnonzero(tested), np.flatnonzero(kept))
        colliding = pairs[overlapping(boxes[pairs[:, 0]], boxes[pairs[:, 1]])]
        # In ascending order of the first: a body that was removed removes no other one.
        for first, second in colliding.tolist():
            kept[second] &= not kept[first]
    return np.asarray(kept | ~solid)


def overlapping(a: Float64, b: Float64) -> Bool:
    """(n,) whether boxes a (n, 7) and b (n, 7) overlap in the plane, by the separating axis theorem."""
    both = np.stack([corners(a), corners(b)])
    apart = np.zeros(len(a), np.bool_)
    for yaw in (a[:, 6], b[:, 6], a[:, 6] + np.pi / 2, b[:, 6] + np.pi / 2):
        axis = np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
        along = np.einsum("bnkd,nd->bnk", both, axis)
        # apart along an axis: the greatest of the lower ends lies above the least of the upper ends
        apart |= along.min(axis=2).max(axis=0) > along.max(axis=2).min(axis=0)
    return ~apart


def _close_pairs(boxes: Float64, some: Int, others: Int) -> Int:
    """(p, 2) pairs of rows whose circumscribed circles overlap, each pair and the list of pairs ascending."""
    radius = np.hypot(boxes[:, 3], boxes[:, 4]) / 2
    gap = np.hypot(*(boxes[some, None, :2] - boxes[None, others, :2]).transpose(2, 0, 1))
    i, j = np.nonzero(gap < radius[some, None] + radius[others])
    pairs = np.sort(np.stack([some[i], others[j]], axis=1), axis=1)
    return np.unique(pairs[pairs[:, 0] != pairs[:, 1]], axis=0)


EGO_M = (4.6, 1.8)
"""Length and width of the ego vehicle."""
OVERHEAD_M = 2.2
"""Parts of scenery above this height are not part of its footprint."""
NONE_M = 1e-3
"""Size of the coat or backpack of a person without one."""
POSTURES = {kinds.SITTER: Posture.SIT, kinds.CYCLIST: Posture.RIDE}
"""Postures of others than pedestrians."""
LOW_M = {
    Posture.FLOOR: (1.3, 0.65, 0.98),
    Posture.CROUCH: (0.8, 0.65, 1.1),
    Posture.KNEEL: (0.95, 0.65, 1.35),
    Posture.LIE: (1.9, 0.75, 0.32),
}
"""Postures near the ground, and the length, width and height of a person in each."""
SCOOTER_M = (1.85, 0.7, 1.15)
"""Length, width and height of a motor scooter."""
RIDER_M = 1.74
"""Standing height of a rider."""
STRIP_M = 0.07
"""Height of a retroreflective strip."""
STRIP_SHARE = 0.04
"""Share of the people who wear one, except cyclists."""
STRIP_SHARE_CYCLISTS = 0.1
"""Share of the cyclists who wear one."""
PITCH_RAD = (0.007, 0.005)
"""Mean and standard deviation of the sensor's pitch: in KITTI's scans people 40 m ahead are 0.3 m too high."""


class SceneBuilder:
    """Collects the bodies of a scene that lasts some seconds."""

    def __init__(self, rng: Generator, seconds: float) -> None:
        self.rng = rng
        self.seconds = seconds
        self.bodies: list[Body] = []
        self._people: list[Person] = []
        (self._strip_rng,) = rng.spawn(1)

    def scenery(
        self, solids: Solids, x: float, y: float, heading_rad: float = 0.0, *, overhead: bool = False
    ) -> None:
        """Add a body at rest without annotation; what is overhead collides with nothing."""
        size = (0.0, 0.0, 0.0) if overhead else _extent(solids)
        self.bodies.append(Body(kinds.SCENERY, size, Path.standing(x, y, heading_rad), solids))

    def vehicle(self, kind: Kind, path: Path, size: Triple | None = None) -> None:
        """Add a car, a van or a truck, of random proportions and, where none is given, random size."""
        random_size, make = {
            kinds.CAR: (vehicles.car_size, vehicles.car),
            kinds.VAN: (vehicles.van_size, vehicles.van),
            kinds.TRUCK: (vehicles.truck_size, vehicles.truck),
        }[kind]
        size = size or random_size(self.rng)
        self.bodies.append(Body(kind, size, path, make(self.rng, size)))

    def parked_bicycle(self, x: float, y: float, heading_rad: float) -> None:
        """Add a bicycle without a rider."""
        path = Path.standing(x, y, heading_rad)
        self.bodies.append(Body(kinds.BICYCLE, (1.75, 0.55, 1.05), path, vehicles.bicycle(self.rng)))

    def pedestrian(self, path: Path, speed_mps: float = 0.0, height: float | None = None, role: str = "") -> None:
        """Add a pedestrian, standing at speed zero."""
        height = height or clipped_normal(self.rng, 1.74, 0.09, 1.15, 2.0)
        length = 0.5
        stride = rate = 0.0
        if speed_mps:
            stride = 0.24 * height * (0.6 + 0.3 * speed_mps)
            rate = np.pi * speed_mps / (2 * stride)
            length = 0.45 + 1.4 * stride
        size = (length, self.rng.uniform(0.55, 0.7), height)
        self._person(kinds.PEDESTRIAN, size, path, height, Solids.none(), rate, stride, role=role)

    def bystander(self, x: float, y: float) -> None:
        """Add a pedestrian who stands and looks anywhere."""
        self.pedestrian(Path.standing(x, y, self.rng.uniform(-np.pi, np.pi)))

    def walker(self, line: ArrayLike, speed_mps: float, start_m: float = 0.0, role: str = "") -> None:
        """Add a pedestrian who walks along a line of way points (n, 2) [m, world], from start_m along it."""
        self.pedestrian(Path.steady(line, start_m, speed_mps, self.seconds), speed_mps, role=role)

    def sitter(self, path: Path) -> None:
        """Add a seated person."""
        height = clipped_normal(self.rng, 1.72, 0.08, 1.5, 1.95)
        seat = box((-0.02, 0.0, 0.22), (0.42, 0.42, 0.44), Material.WOOD)
        self._person(kinds.SITTER, (0.8, 0.6, 1.32), path, height, seat)

    def posed(
        self,
        posture: Posture,
        path: Path,
        size: Triple,
        height: float,
        things: Solids,
        joints: Mapping[str, Any],
        role: str = "",
    ) -> None:
        """Add a pedestrian with what belongs to them.

        Args:
            posture: the posture.
            path: the way.
            size: length, width and height with all things.
            height: standing height of the person [m].
            things: what they carry, wear or sit on, body frame.
            joints: fields of Person, differences of the joints from those of the posture.
            role: for the evaluation.
        """
        self._person(kinds.PEDESTRIAN, size, path, height, things, posture=posture, role=role)
        self._people[-1] = self._people[-1]._replace(**joints)

    def rider(self, kind: Kind, size: Triple, path: Path, vehicle: Solids, posture: Posture, role: str) -> None:
        """Add a person on a vehicle, both as one body."""
        self._person(kind, size, path, RIDER_M, vehicle, posture=posture, role=role)

    def cyclist(self, path: Path, speed_mps: float, height: float | None = None) -> None:
        """Add a cyclist."""
        height = height or clipped_normal(self.rng, 1.74, 0.08, 1.5, 1.95)
        size = (1.76, 0.6, 0.93 + 0.3 * height * np.cos(0.55) + 0.24 * height)
        bicycle = vehicles.bicycle(self.rng)
        self._person(kinds.CYCLIST, size, path, height, bicycle, 2 * np.pi * speed_mps / 4.5)

    def parked_scooter(self, x: float, y: float, heading_rad: float) -> None:
        """Add a motor scooter without a rider."""
        path = Path.standing(x, y, heading_rad)
        self.bodies.append(Body(kinds.BICYCLE, SCOOTER_M, path, vehicles.motor_scooter(self.rng)))

    def scooter_rider(self, path: Path) -> None:
        """Add a person on a motor scooter, who sits upright with the feet on the floorboard."""
        height = clipped_normal(self.rng, 1.68, 0.08, 1.5, 1.9)
        length, width, _ = SCOOTER_M
        scooter = vehicles.motor_scooter(self.rng)
        self._person(kinds.CYCLIST, (length, width, 0.8 + 0.5 * height), path, height, scooter, posture=Posture.RIDE)
        lean = self.rng.normal(-0.4, 0.12)
        self._people[-1] = self._people[-1]._replace(lean=lean, hips_x=-0.05, hips_z=-0.1, feet_x=0.1)

    def world(
        self,
        terrain: Terrain,
        ego: Path,
        height_m: float,
        sway_rad: float = 0.003,
        ego_m: Pair = EGO_M,
        margin_m: float = MARGIN_M,
    ) -> World:
        """The world of the bodies that collide neither with the ego vehicle nor with one another.

        Of two that collide, moving bodies take precedence over bodies at rest, earlier ones over later ones.
        """
        order = sorted(range(len(self.bodies)), key=lambda i: self.bodies[i].path.at_rest)
        paths = [ego, *(self.bodies[i].path for i in order)]
        footprint = np.array([ego_m, *(self.bodies[i].size[:2] for i in order)])
        kept = without_collisions(paths, footprint, self.seconds, margin_m)[1:]
        remaining = sorted(i for i, k in zip(order, kept, strict=True) if k)
        number = {old: new for new, old in enumerate(remaining)}
        people = [p._replace(body=number[p.body]) for p in self._people if p.body in number]
        mount = self.rng.normal(0.0, 0.004), self.rng.normal(*PITCH_RAD)
        bodies = [self.bodies[i] for i in remaining]
        return World(terrain, bodies, np.array(people, PERSON), ego, height_m, sway_rad, mount)

    def _person(
        self,
        kind: Kind,
        size: Triple,
        path: Path,
        height: float,
        rigid: Solids,
        rate: float = 0,
        stride: float = 0,
        posture: Posture | None = None,
        role: str = "",
    ) -> None:
        if posture is None:
            posture = POSTURES.get(kind, Posture.WALK if rate else Posture.STAND)
        girth = clipped_normal(self.rng, 1.0, 0.12, 0.75, 1.35)
        phase = self.rng.uniform(0, 2 * np.pi)
        coat = self.rng.uniform(0.16, 0.24) if self.rng.random() < 0.35 else NONE_M
        pack = self.rng.uniform(0.08, 0.16) if self.rng.random() < 0.3 else NONE_M
        if posture in LOW_M:
            coat = pack = NONE_M
        share = STRIP_SHARE_CYCLISTS if posture == Posture.RIDE else STRIP_SHARE
        strip = STRIP_M * (self._strip_rng.random() < share)
        body = len(self.bodies)
        self._people.append(Person(body, posture, height, girth, phase, rate, stride, coat, pack, strip))
        self.bodies.append(Body(kind, size, path, rigid, role))


def _extent(solids: Solids) -> Triple:
    """Size of the smallest box centred on the origin that holds the opaque parts below OVERHEAD_M."""
    low = solids.take((solids.centre[:, 2] - solids.half[:, 2] < OVERHEAD_M) & ~np.isfinite(solids.density))
    if not len(low):
        return 0.0, 0.0, 0.0
    reach = np.abs(low.centre) + (np.abs(low.rotation) @ low.half[:, :, None])[:, :, 0]
    length, width, height = (2 * reach.max(axis=0)).tolist()
    return length, width, height / 2
