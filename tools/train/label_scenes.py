"""Scenes from KITTI label files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from modt.errors import MisuseError
from modt_desk.simulation import kinds, road, roadside
from modt_desk.simulation.builder import SceneBuilder
from modt_desk.simulation.motion import Path as Trajectory
from modt_desk.simulation.sensors import sensor
from modt_desk.simulation.simulator import Simulator
from modt_desk.simulation.street import furnish, residential
from modt_desk.simulation.world import World

CAMERA_AHEAD_M = 0.27
N_FIELDS = 15
KINDS = {
    kind.name: kind for kind in (kinds.CAR, kinds.VAN, kinds.TRUCK, kinds.PEDESTRIAN, kinds.SITTER, kinds.CYCLIST)
} | {"Tram": kinds.TRUCK}
"""Kind that a KITTI object type is simulated by."""


@dataclass(frozen=True, slots=True)
class Placement:
    """An object of a label file.

    Attributes:
        kind: of the object.
        size: length, width, height [m].
        x, y: position [m, sensor frame].
        heading_rad: in the sensor frame.
    """

    kind: kinds.Kind
    size: tuple[float, float, float]
    x: float
    y: float
    heading_rad: float


def read_placements(path: Path) -> list[Placement]:
    """Objects of a KITTI label file, in the frame of a sensor at its nominal pose to the camera.

    Raises:
        MisuseError: the file is unreadable or no label file.
    """
    remedy = "give a KITTI object label_2 file"
    try:
        rows = [line.split() for line in path.read_text(encoding="ascii").splitlines()]
        values = [[float(v) for v in row[1:N_FIELDS]] for row in rows]
    except (OSError, ValueError):
        raise MisuseError(path, "no label file", remedy) from None
    if any(len(v) != N_FIELDS - 1 for v in values):
        raise MisuseError(path, f"a line without its {N_FIELDS} columns", remedy)
    return [
        Placement(KINDS[row[0]], (v[9], v[8], v[7]), v[12] + CAMERA_AHEAD_M, -v[10], float(-v[13] - np.pi / 2))
        for row, v in zip(rows, values, strict=True)
        if row[0] in KINDS
    ]


def label_scene(path: Path, seed: int, name: str = "hdl-64e") -> Simulator:
    """Simulator of a scan of a sensor in the world of a label file.

    Raises:
        MisuseError: the file is unreadable or no label file.
    """
    model = sensor(name)
    world = _placed(read_placements(path), np.random.default_rng([seed, 0]), model.period_s, model.height_m)
    return Simulator(world, model, seed)


def _placed(placements: list[Placement], rng: np.random.Generator, seconds: float, height_m: float) -> World:
    """A residential street with these objects alone, all at rest, before a sensor at rest."""
    street = residential(rng, 60.0)
    builder = SceneBuilder(rng, seconds)
    x0, y0, yaw0 = street.place(0.0, -street.half_m * roadside.LANE)
    c, s = np.cos(yaw0), np.sin(yaw0)
    for p in placements:
        spot = Trajectory.standing(x0 + c * p.x - s * p.y, y0 + s * p.x + c * p.y, yaw0 + p.heading_rad)
        if p.kind in (kinds.CAR, kinds.VAN, kinds.TRUCK):
            builder.vehicle(p.kind, spot, p.size)
        elif p.kind is kinds.CYCLIST:
            builder.cyclist(spot, 0.0, height=p.size[2] * 0.97)
        elif p.kind is kinds.SITTER:
            builder.sitter(spot)
        else:
            walking = rng.random() < 0.7
            builder.pedestrian(spot, float(rng.uniform(0.8, 1.8)) if walking else 0.0, height=p.size[2])
    furnish(builder, street)
    return builder.world(road.terrain_along(rng, street), Trajectory.standing(x0, y0, yaw0), height_m)
