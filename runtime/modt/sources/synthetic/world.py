"""The world: ground, bodies and where everything is at a time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.geometry import inverse, rotation_zyx, se3
from modt.sources.synthetic.figures import Figures
from modt.sources.synthetic.kinds import Kind
from modt.sources.synthetic.motion import Path
from modt.sources.synthetic.pieces import Pieces
from modt.sources.synthetic.terrain import Terrain
from modt.types import Float32, Float64

MOVING_MPS = 0.3
"""A body slower than this stands."""


@dataclass(frozen=True)
class Body:
    """One thing in the world.

    Attributes:
        kind: what it is.
        size: length, width, height of its box [m].
        path: where it is.
        still: it never moves: its pieces are placed in the world once.
        pieces: its rigid parts, own frame (x ahead, z up, origin on the ground beneath its middle).
    """

    kind: Kind
    size: tuple[float, float, float]
    path: Path
    pieces: Pieces

    @property
    def still(self) -> bool:
        """Whether it never moves."""
        return len(self.path.xy) == 1


class World:
    """Everything there is.

    Args:
        terrain: the ground.
        bodies: the things on it.
        figures: the people among them, whose limbs move.
        ego: where the sensor's carrier goes.
        height_m: of the sensor above the ground.
        sway_rad: how far the carrier rolls and pitches.
        exclude: pieces of bodies nearer to the ego's line than nothing.
    """

    def __init__(
        self, terrain: Terrain, bodies: list[Body], figures: Figures, ego: Path, height_m: float, sway_rad: float
    ) -> None:
        self.terrain, self.bodies, self.figures = terrain, bodies, figures
        self.ego, self.height_m, self.sway_rad = ego, height_m, sway_rad
        self._still = Pieces.join(
            b.pieces.of(i).moved(*self._placement(b, 0.0)) for i, b in enumerate(bodies) if b.still and len(b.pieces)
        )
        self._rolling = [(i, b, b.pieces.of(i)) for i, b in enumerate(bodies) if not b.still and len(b.pieces)]

    def ego_pose(self, time_s: float) -> Float64:
        """(4, 4) T_world_sensor."""
        x, y, yaw = self.ego.at(time_s)
        ahead, left = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
        z = self._smooth(x, y)
        rise = self._smooth(x + 1.3 * ahead[0], y + 1.3 * ahead[1]) - self._smooth(
            x - 1.3 * ahead[0], y - 1.3 * ahead[1]
        )
        bank = self._smooth(x + 0.8 * left[0], y + 0.8 * left[1]) - self._smooth(x - 0.8 * left[0], y - 0.8 * left[1])
        pitch = -np.arctan2(rise, 2.6) + self.sway_rad * np.sin(2.9 * time_s)
        roll = np.arctan2(bank, 1.6) + self.sway_rad * np.sin(2.1 * time_s + 1.0)
        return se3(rotation_zyx(float(roll), float(pitch), yaw), np.array([x, y, z + self.height_m]))

    def pose(self, body: Body, time_s: float) -> tuple[float, float, float, float]:
        """x, y, z of a body's foot [m, world] and its heading [rad]."""
        x, y, yaw = body.path.at(time_s)
        return x, y, self.terrain.height_at(x, y), yaw

    def boxes(self, time_s: float) -> Float64:
        """(n, 7) box of each body, world frame."""
        out = np.zeros((len(self.bodies), 7))
        for i, body in enumerate(self.bodies):
            x, y, z, yaw = self.pose(body, time_s)
            length, width, height = body.size
            out[i] = x, y, z + height / 2, length, width, height, yaw
        return out

    def pieces(self, time_s: float, T_world_sensor: Float64, reach_m: float) -> Pieces:
        """Pieces within reach of the sensor at a time, sensor frame."""
        groups = [self._near(self._still, T_world_sensor, reach_m)]
        for _, body, parts in self._rolling:
            groups.append(parts.moved(*self._placement(body, time_s)))
        if len(self.figures.body):
            local = self.figures.pieces(time_s)
            poses = [self._placement(self.bodies[i], time_s) for i in self.figures.body.tolist()]
            repeat = len(local) // len(poses)
            R = np.tile(np.stack([p[0] for p in poses]), (repeat, 1, 1))
            t = np.tile(np.stack([p[1] for p in poses]), (repeat, 1))
            groups.append(self._near(local.moved(R, t), T_world_sensor, reach_m))
        T = inverse(T_world_sensor)
        return Pieces.join(groups).moved(T[:3, :3], T[:3, 3])

    def _near(self, pieces: Pieces, T_world_sensor: Float64, reach_m: float) -> Pieces:
        away = np.hypot(*(pieces.centre[:, :2] - T_world_sensor[:2, 3].astype(np.float32)).T)
        return pieces.take(away < reach_m + np.linalg.norm(pieces.half[:, :2], axis=1))

    def _placement(self, body: Body, time_s: float) -> tuple[Float32, Float32]:
        x, y, z, yaw = self.pose(body, time_s)
        c, s = np.cos(yaw), np.sin(yaw)
        R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]], np.float32)
        return R, np.array([x, y, z], np.float32)

    def _smooth(self, x: float, y: float) -> float:
        offsets = np.array([-0.5, 0.0, 0.5], np.float32)
        cell = self.terrain.cells(np.float32(x) + offsets[:, None], np.float32(y) + offsets)
        return float(self.terrain.height.ravel()[cell].mean())
