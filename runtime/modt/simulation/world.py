"""The world: ground, bodies and where everything is at a time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.geometry import inverse, rotation_zyx, se3
from modt.simulation.kinds import Kind
from modt.simulation.motion import Path
from modt.simulation.people import Figures
from modt.simulation.solids import Pieces
from modt.simulation.terrain import Terrain
from modt.types import Float64

MOVING_MPS = 0.3
"""A body slower than this stands."""


@dataclass(frozen=True)
class Body:
    """One thing in the world.

    Attributes:
        kind: what it is.
        size: length, width, height of its box [m].
        path: where it is.
        pieces: its rigid parts, own frame (x ahead, z up, origin on the ground beneath its middle).
    """

    kind: Kind
    size: tuple[float, float, float]
    path: Path
    pieces: Pieces

    @property
    def footprint(self) -> tuple[float, float]:
        """Length and width of the ground that it takes up [m]."""
        return self.size[:2]

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
        mount_rad: roll and pitch of the sensor on its carrier; cars nose down a little.
    """

    def __init__(
        self,
        terrain: Terrain,
        bodies: list[Body],
        figures: Figures,
        ego: Path,
        height_m: float,
        sway_rad: float,
        mount_rad: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        self.terrain, self.bodies, self.figures = terrain, bodies, figures
        self.ego, self.height_m, self.sway_rad, self.mount_rad = ego, height_m, sway_rad, mount_rad
        self._moving = [i for i, b in enumerate(bodies) if not b.still]
        self._rest = np.zeros((len(bodies), 5))
        for i, body in enumerate(bodies):
            x, y, yaw = body.path.at(0.0)
            self._rest[i, [0, 1, 3]] = x, y, yaw
        self._rest[:, 2] = terrain.heights(self._rest[:, 0], self._rest[:, 1])
        still = Pieces.join(b.pieces.of(i) for i, b in enumerate(bodies) if b.still)
        self._still = self._placed(still, self._rest)
        self._rolling = Pieces.join(bodies[i].pieces.of(i) for i in self._moving)

    def ego_pose(self, time_s: float) -> Float64:
        """(4, 4) T_world_sensor."""
        x, y, yaw = self.ego.at(time_s)
        ahead, left = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
        z = self._smooth(x, y)
        rise = self._smooth(x + 1.3 * ahead[0], y + 1.3 * ahead[1]) - self._smooth(
            x - 1.3 * ahead[0], y - 1.3 * ahead[1]
        )
        bank = self._smooth(x + 0.8 * left[0], y + 0.8 * left[1]) - self._smooth(x - 0.8 * left[0], y - 0.8 * left[1])
        pitch = self.mount_rad[1] - np.arctan2(rise, 2.6) + self.sway_rad * np.sin(2.9 * time_s)
        roll = self.mount_rad[0] + np.arctan2(bank, 1.6) + self.sway_rad * np.sin(2.1 * time_s + 1.0)
        return se3(rotation_zyx(float(roll), float(pitch), yaw), np.array([x, y, z + self.height_m]))

    def poses(self, time_s: float) -> Float64:
        """(n, 5) of each body x, y, z of its foot [m, world], heading [rad], speed [m/s]."""
        out = self._rest.copy()
        if self._moving:
            rows = np.array(self._moving)
            moved = np.array(
                [(*self.bodies[i].path.at(time_s), self.bodies[i].path.speed(time_s)) for i in self._moving]
            )
            out[rows, :2], out[rows, 3:] = moved[:, :2], moved[:, 2:]
            out[rows, 2] = self.terrain.heights(moved[:, 0], moved[:, 1])
        return out

    def boxes(self, time_s: float) -> Float64:
        """(n, 7) box of each body, world frame."""
        pose = self.poses(time_s)
        size = np.array([b.size for b in self.bodies]).reshape(-1, 3)
        foot = pose[:, :3] + size * [0, 0, 0.5]
        return np.column_stack([foot, size, pose[:, 3]])

    def pieces(self, time_s: float, T_world_sensor: Float64, reach_m: float) -> Pieces:
        """Pieces within reach of the sensor at a time, sensor frame."""
        poses = self.poses(time_s)
        away = np.hypot(*(poses[self.figures.body, :2] - T_world_sensor[:2, 3]).T)
        people = self.figures.take(away < reach_m).pieces(time_s)
        moving = Pieces.join([self._rolling, people])
        near = [self._near(p, T_world_sensor, reach_m) for p in (self._still, self._placed(moving, poses))]
        T = inverse(T_world_sensor)
        return Pieces.join(near).moved(T[:3, :3], T[:3, 3])

    def _near(self, pieces: Pieces, T_world_sensor: Float64, reach_m: float) -> Pieces:
        away = np.hypot(*(pieces.centre[:, :2] - T_world_sensor[:2, 3].astype(np.float32)).T)
        return pieces.take(away < reach_m + np.linalg.norm(pieces.half[:, :2], axis=1))

    @staticmethod
    def _placed(pieces: Pieces, poses: Float64) -> Pieces:
        """The pieces where their bodies are."""
        c, s = np.cos(poses[:, 3]), np.sin(poses[:, 3])
        R = np.zeros((len(poses), 3, 3), np.float32)
        R[:, 0, 0], R[:, 0, 1], R[:, 1, 0], R[:, 1, 1], R[:, 2, 2] = c, -s, s, c, 1
        return pieces.moved(R[pieces.body], poses[pieces.body, :3])

    def _smooth(self, x: float, y: float) -> float:
        offsets = np.array([-0.5, 0.0, 0.5], np.float32)
        cell = self.terrain.cells(np.float32(x) + offsets[:, None], np.float32(y) + offsets)
        return float(self.terrain.height.ravel()[cell].mean())
