"""Gathers bodies while a scene is laid out."""

from __future__ import annotations

import numpy as np

from modt.simulation import kinds, vehicles
from modt.simulation.collisions import keep_apart
from modt.simulation.kinds import Kind
from modt.simulation.materials import Material
from modt.simulation.motion import Path
from modt.simulation.people import Figures, Posture
from modt.simulation.solids import Pieces, box
from modt.simulation.terrain import Terrain
from modt.simulation.world import Body, World
from modt.types import Float64

EGO_SIZE = (4.6, 1.8, 1.6)
REACH_UP_M = 2.2
"""Parts of scenery above this are in nobody's way."""

BARE_M = 1e-3
STRIP_M, STRIP_WALKER, STRIP_RIDER = 0.07, 0.04, 0.1
"""A strip that throws light back, and the share of people on foot and on bicycles who wear one."""
NOSE_DOWN_RAD = (0.007, 0.005)
"""Mean and spread of the sensor's pitch on its carrier: people 40 m ahead stand 0.3 m too high in real scans."""


class Builder:
    """A world in the making.

    Args:
        rng: of the scene.
        seconds: how long it lasts.
    """

    def __init__(self, rng: np.random.Generator, seconds: float) -> None:
        self.rng, self.seconds = rng, seconds
        self.bodies: list[Body] = []
        self._people: list[tuple[float, ...]] = []
        self._dress = rng.spawn(1)[0]  # its own, so that scenes stay what they were

    def scenery(self, pieces: Pieces, x: float, y: float, heading_rad: float) -> None:
        """Something that is not annotated and never moves."""
        self.bodies.append(Body(kinds.SCENERY, _extent(pieces), Path.standing(x, y, heading_rad), pieces))

    def vehicle(self, kind: Kind, path: Path, size: tuple[float, float, float] | None = None) -> None:
        """A car, a van or a truck, of random proportions unless its size is given."""
        usual, make = {
            kinds.CAR: (vehicles.car_size, vehicles.car),
            kinds.VAN: (vehicles.van_size, vehicles.van),
            kinds.TRUCK: (vehicles.truck_size, vehicles.truck),
        }[kind]
        measured = size or usual(self.rng)
        self.bodies.append(Body(kind, measured, path, make(self.rng, measured)))

    def parked_bicycle(self, x: float, y: float, heading_rad: float) -> None:
        """A bicycle without a rider."""
        path = Path.standing(x, y, heading_rad)
        self.bodies.append(Body(kinds.BICYCLE, (1.75, 0.55, 1.05), path, vehicles.bicycle(self.rng)))

    def pedestrian(self, path: Path, speed_mps: float = 0.0, height: float | None = None) -> None:
        """Someone on foot: walking where a speed is given, else standing."""
        height = height or float(np.clip(self.rng.normal(1.74, 0.09), 1.15, 2.0))
        stride = 0.24 * height * (0.6 + 0.3 * speed_mps) if speed_mps else 0.0
        rate = np.pi * speed_mps / (2 * stride) if speed_mps else 0.0
        length = 0.45 + 1.4 * stride if speed_mps else 0.5
        breadth = float(self.rng.uniform(0.55, 0.7))
        posture = Posture.WALK if speed_mps else Posture.STAND
        self._person(kinds.PEDESTRIAN, (length, breadth, height), path, posture, height, rate, stride, Pieces.none())

    def sitter(self, path: Path) -> None:
        """Someone on a seat."""
        height = float(np.clip(self.rng.normal(1.72, 0.08), 1.5, 1.95))
        seat = box((-0.02, 0.0, 0.22), (0.42, 0.42, 0.44), Material.WOOD)
        self._person(kinds.SITTER, (0.8, 0.6, 1.32), path, Posture.SIT, height, 0.0, 0.0, seat)

    def cyclist(self, path: Path, speed_mps: float, height: float | None = None) -> None:
        """Someone on a bicycle."""
        height = height or float(np.clip(self.rng.normal(1.74, 0.08), 1.5, 1.95))
        size = (1.76, 0.6, 0.93 + 0.3 * height * np.cos(0.55) + 0.24 * height)
        rate = 2 * np.pi * speed_mps / 4.5
        self._person(kinds.CYCLIST, size, path, Posture.RIDE, height, rate, 0.0, vehicles.bicycle(self.rng))

    def world(self, terrain: Terrain, ego: Path, height_m: float, sway_rad: float = 0.003) -> World:
        """The world as it stands, without those who would run into the ego vehicle or one another.

        Of two that meet, what moves stays before what stands, and what was added first before what came later.
        """
        order = sorted(range(len(self.bodies)), key=lambda i: self.bodies[i].still)
        ego_body = Body(kinds.CAR, EGO_SIZE, ego, Pieces.none())
        kept = keep_apart([ego_body, *(self.bodies[i] for i in order)], self.seconds)[1:]
        stay = sorted(i for i, k in zip(order, kept, strict=True) if k)
        number = {old: new for new, old in enumerate(stay)}
        people = [(number[int(p[0])], *p[1:]) for p in self._people if int(p[0]) in number]
        columns: Float64 = np.array(people).reshape(-1, 10).T
        figures = Figures(columns[0].astype(np.int64), columns[1].astype(np.int64), *columns[2:])
        mount = float(self.rng.normal(0.0, 0.004)), float(self.rng.normal(*NOSE_DOWN_RAD))
        return World(terrain, [self.bodies[i] for i in stay], figures, ego, height_m, sway_rad, mount)

    def _person(
        self,
        kind: Kind,
        size: tuple[float, float, float],
        path: Path,
        posture: Posture,
        height: float,
        rate: float,
        stride: float,
        rigid: Pieces,
    ) -> None:
        girth = float(np.clip(self.rng.normal(1.0, 0.12), 0.75, 1.35))
        phase = float(self.rng.uniform(0, 2 * np.pi))
        coat = self.rng.uniform(0.16, 0.24) if self.rng.random() < 0.35 else BARE_M
        pack = self.rng.uniform(0.08, 0.16) if self.rng.random() < 0.3 else BARE_M
        strip = STRIP_M * (self._dress.random() < (STRIP_RIDER if posture == Posture.RIDE else STRIP_WALKER))
        self._people.append((len(self.bodies), posture, height, girth, phase, rate, stride, coat, pack, strip))
        self.bodies.append(Body(kind, size, path, rigid))


def _extent(pieces: Pieces) -> tuple[float, float, float]:
    """Size of the smallest box around the foot that holds the solid parts in people's way."""
    low = (pieces.centre[:, 2] - pieces.half[:, 2] < REACH_UP_M) & ~np.isfinite(pieces.density)
    if not low.any():
        return 0.0, 0.0, 0.0
    reach = np.abs(pieces.centre[low]) + (np.abs(pieces.rotation[low]) @ pieces.half[low][:, :, None])[:, :, 0]
    length, width, height = (2 * reach.max(axis=0)).tolist()
    return float(length), float(width), float(height / 2)
