"""Scenes built from where real objects stood: KITTI label files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from modt.errors import MisuseError
from modt.simulation import kinds, roadside
from modt.simulation.builder import Builder
from modt.simulation.kinds import Kind
from modt.simulation.layout import BESIDE_M, terrain
from modt.simulation.motion import Path as Line
from modt.simulation.street import dress, residential
from modt.simulation.world import World

CAMERA_AHEAD_M = 0.27
KINDS: dict[str, Kind] = {
    "Car": kinds.CAR,
    "Van": kinds.VAN,
    "Truck": kinds.TRUCK,
    "Tram": kinds.TRUCK,
    "Pedestrian": kinds.PEDESTRIAN,
    "Person_sitting": kinds.SITTER,
    "Cyclist": kinds.CYCLIST,
}
FIELDS = 15


@dataclass(frozen=True, slots=True)
class Placement:
    """An object of a label file.

    Attributes:
        kind: what it is.
        size: length, width, height [m].
        x, y: its place [m, sensor frame].
        heading_rad: its direction there.
    """

    kind: Kind
    size: tuple[float, float, float]
    x: float
    y: float
    heading_rad: float


def read_placements(path: Path) -> list[Placement]:
    """The objects of a KITTI label file, as seen from a sensor that stands nominally to the camera.

    Raises:
        MisuseError: it cannot be read, or is no label file.
    """
    try:
        rows = [line.split() for line in path.read_text(encoding="ascii").splitlines()]
        values = [[float(v) for v in row[1:FIELDS]] for row in rows]
    except (OSError, ValueError):
        raise MisuseError(path, "no label file", "give a KITTI object label_2 file") from None
    if any(len(v) != FIELDS - 1 for v in values):
        raise MisuseError(path, f"a line without its {FIELDS} columns", "give a KITTI object label_2 file")
    return [
        Placement(KINDS[row[0]], (v[9], v[8], v[7]), v[12] + CAMERA_AHEAD_M, -v[10], float(-v[13] - np.pi / 2))
        for row, v in zip(rows, values, strict=True)
        if row[0] in KINDS
    ]


def placed(placements: list[Placement], rng: np.random.Generator, seconds: float, height_m: float) -> World:
    """A residential street with nobody on it but these objects, standing as they did before a standing sensor."""
    road = residential(rng, 60.0)
    builder = Builder(rng, seconds)
    x0, y0, yaw0 = road.place(0.0, -road.half_m * roadside.LANE)
    c, s = np.cos(yaw0), np.sin(yaw0)
    for p in placements:
        spot = Line.standing(x0 + c * p.x - s * p.y, y0 + s * p.x + c * p.y, yaw0 + p.heading_rad)
        if p.kind in (kinds.CAR, kinds.VAN, kinds.TRUCK):
            builder.vehicle(p.kind, spot, p.size)
        elif p.kind is kinds.CYCLIST:
            builder.cyclist(spot, 0.0, height=p.size[2] * 0.97)
        elif p.kind is kinds.SITTER:
            builder.sitter(spot)
        elif rng.random() < 0.7:
            builder.pedestrian(spot, float(rng.uniform(0.8, 1.8)), height=p.size[2])
        else:
            builder.pedestrian(spot, height=p.size[2])
    dress(builder, road)
    low, high = (road.start_m, -BESIDE_M), (road.end_m, BESIDE_M)
    return builder.world(terrain(rng, [road], low, high), Line.standing(x0, y0, yaw0), height_m)
