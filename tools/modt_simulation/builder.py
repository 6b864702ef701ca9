"""Builder of a scene: collects bodies and makes the world of those that do not collide."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from modt.geometry import corners
from modt.types import Bool, Float64, Int
from modt_simulation import kinds, vehicles
from modt_simulation.kinds import Kind
from modt_simulation.materials import Material
from modt_simulation.motion import Path
from modt_simulation.people import People, Posture
from modt_simulation.solids import Solids, Triple, box
from modt_simulation.terrain import Terrain
from modt_simulation.world import Body, World

STEP_S, MARGIN_M = 0.25, 0.1


def without_collisions(paths: Sequence[Path], footprint: Float64, seconds: float) -> Bool:
    """(n,) which bodies stay, by path and footprint (n, 2) [m]. Of two that collide, the first one stays.

    Bodies of zero footprint do not collide. Pairs at rest are tested once.
    """
    solid = footprint.min(axis=1) > 0
    kept = solid.copy()
    boxes = np.zeros((len(paths), 7))
    boxes[:, 3:5] = footprint + 2 * MARGIN_M
    boxes[:, [0, 1, 6]] = [path.at(0.0) for path in paths]
    moving = np.array([not path.at_rest for path in paths])
    for step in range(int(seconds / STEP_S) + 2):
        for row in np.flatnonzero(moving & kept).tolist():
            boxes[row, [0, 1, 6]] = paths[row].at(step * STEP_S)
        first = np.flatnonzero(kept & moving) if step else np.flatnonzero(kept)
        pairs = _close_pairs(boxes, first, np.flatnonzero(kept))
        colliding = pairs[overlapping(boxes[pairs[:, 0]], boxes[pairs[:, 1]])]
        for a, b in colliding[np.argsort(colliding[:, 0], kind="stable")].tolist():
            kept[b] &= not kept[a]
    return np.asarray(kept | ~solid)


def overlapping(a: Float64, b: Float64) -> Bool:
    """(n,) whether boxes a (n, 7) and b (n, 7) overlap in the plane, by the separating axis theorem."""
    ca, cb = corners(a), corners(b)
    apart = np.zeros(len(a), np.bool_)
    for yaw in (a[:, 6], b[:, 6], a[:, 6] + np.pi / 2, b[:, 6] + np.pi / 2):
        axis = np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
        pa, pb = np.einsum("nkd,nd->nk", ca, axis), np.einsum("nkd,nd->nk", cb, axis)
        apart |= (pa.max(axis=1) < pb.min(axis=1)) | (pb.max(axis=1) < pa.min(axis=1))
    return ~apart


def _close_pairs(boxes: Float64, some: Int, others: Int) -> Int:
    """(p, 2) ascending pairs of rows whose circumscribed circles overlap."""
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
STRIP_M, STRIP_SHARE, STRIP_SHARE_CYCLISTS = 0.07, 0.04, 0.1
"""Height of a retroreflective strip, and the shares of pedestrians and of cyclists who wear one."""
PITCH_RAD = (0.007, 0.005)
"""Mean and standard deviation of the sensor's pitch: in KITTI's scans people 40 m ahead are 0.3 m too high."""


class SceneBuilder:
    """Collects the bodies of a scene that lasts some seconds."""

    def __init__(self, rng: np.random.Generator, seconds: float) -> None:
        self.rng, self.seconds = rng, seconds
        self.bodies: list[Body] = []
        self._people: list[tuple[float, ...]] = []
        self._strip_rng = rng.spawn(1)[0]

    def scenery(self, solids: Solids, x: float, y: float, heading_rad: float) -> None:
        """Add a body at rest without annotation."""
        self.bodies.append(Body(kinds.SCENERY, _extent(solids), Path.standing(x, y, heading_rad), solids))

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

    def pedestrian(self, path: Path, speed_mps: float = 0.0, height: float | None = None) -> None:
        """Add a pedestrian, standing at speed zero."""
        height = height or self._height(1.74, 0.09, 1.15, 2.0)
        stride = 0.24 * height * (0.6 + 0.3 * speed_mps) if speed_mps else 0.0
        rate = np.pi * speed_mps / (2 * stride) if speed_mps else 0.0
        size = (0.45 + 1.4 * stride if speed_mps else 0.5, float(self.rng.uniform(0.55, 0.7)), height)
        self._person(kinds.PEDESTRIAN, size, path, height, Solids.none(), rate, stride)

    def sitter(self, path: Path) -> None:
        """Add a seated person."""
        height = self._height(1.72, 0.08, 1.5, 1.95)
        seat = box((-0.02, 0.0, 0.22), (0.42, 0.42, 0.44), Material.WOOD)
        self._person(kinds.SITTER, (0.8, 0.6, 1.32), path, height, seat)

    def cyclist(self, path: Path, speed_mps: float, height: float | None = None) -> None:
        """Add a cyclist."""
        height = height or self._height(1.74, 0.08, 1.5, 1.95)
        size = (1.76, 0.6, 0.93 + 0.3 * height * np.cos(0.55) + 0.24 * height)
        bicycle = vehicles.bicycle(self.rng)
        self._person(kinds.CYCLIST, size, path, height, bicycle, 2 * np.pi * speed_mps / 4.5)

    def world(
        self,
        terrain: Terrain,
        ego: Path,
        height_m: float,
        sway_rad: float = 0.003,
        ego_m: tuple[float, float] = EGO_M,
    ) -> World:
        """The world of the bodies that collide neither with the ego vehicle nor with one another.

        Of two that collide, moving bodies take precedence over bodies at rest, earlier ones over later ones.
        """
        order = sorted(range(len(self.bodies)), key=lambda i: self.bodies[i].path.at_rest)
        paths = [ego, *(self.bodies[i].path for i in order)]
        footprint = np.array([ego_m, *(self.bodies[i].size[:2] for i in order)])
        kept = without_collisions(paths, footprint, self.seconds)[1:]
        remaining = sorted(i for i, k in zip(order, kept, strict=True) if k)
        number = {old: new for new, old in enumerate(remaining)}
        rows = [(number[int(p[0])], *p[1:]) for p in self._people if int(p[0]) in number]
        columns: Float64 = np.array(rows).reshape(-1, 10).T
        people = People(columns[0].astype(np.int64), columns[1].astype(np.int64), *columns[2:])
        mount = float(self.rng.normal(0.0, 0.004)), float(self.rng.normal(*PITCH_RAD))
        return World(terrain, [self.bodies[i] for i in remaining], people, ego, height_m, sway_rad, mount)

    def _height(self, mean: float, sigma: float, low: float, high: float) -> float:
        return float(np.clip(self.rng.normal(mean, sigma), low, high))

    def _person(
        self, kind: Kind, size: Triple, path: Path, height: float, rigid: Solids, rate: float = 0, stride: float = 0
    ) -> None:
        posture = POSTURES.get(kind, Posture.WALK if rate else Posture.STAND)
        girth = float(np.clip(self.rng.normal(1.0, 0.12), 0.75, 1.35))
        phase = float(self.rng.uniform(0, 2 * np.pi))
        coat = self.rng.uniform(0.16, 0.24) if self.rng.random() < 0.35 else NONE_M
        pack = self.rng.uniform(0.08, 0.16) if self.rng.random() < 0.3 else NONE_M
        share = STRIP_SHARE_CYCLISTS if posture == Posture.RIDE else STRIP_SHARE
        strip = STRIP_M * (self._strip_rng.random() < share)
        self._people.append((len(self.bodies), posture, height, girth, phase, rate, stride, coat, pack, strip))
        self.bodies.append(Body(kind, size, path, rigid))


def _extent(solids: Solids) -> Triple:
    """Size of the smallest box centred on the origin that holds the opaque parts below OVERHEAD_M."""
    low = solids.take((solids.centre[:, 2] - solids.half[:, 2] < OVERHEAD_M) & ~np.isfinite(solids.density))
    if not len(low):
        return 0.0, 0.0, 0.0
    reach = np.abs(low.centre) + (np.abs(low.rotation) @ low.half[:, :, None])[:, :, 0]
    length, width, height = (2 * reach.max(axis=0)).tolist()
    return length, width, height / 2
