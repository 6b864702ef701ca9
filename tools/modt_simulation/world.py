"""The world: ground, bodies and their poses over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.geometry import inverse, rotation_zyx, se3
from modt.types import Float64
from modt_simulation.gait import Gait
from modt_simulation.kinds import Kind
from modt_simulation.motion import Path
from modt_simulation.people import People, people_solids
from modt_simulation.solids import Pair, Solids, Triple
from modt_simulation.terrain import Terrain

MOVING_MPS = 0.3
"""Least speed of a body annotated as moving."""


@dataclass(frozen=True)
class Body:
    """One object or piece of scenery."""

    kind: Kind  # kind of the body
    size: Triple  # length, width, height of its box [m]
    path: Path  # motion of the body
    solids: Solids  # its rigid parts, body frame (x ahead, z up, origin on the ground beneath the centre)
    role: str = ""  # what it does in its scene; empty if its kind says it all


@dataclass
class World:
    """All bodies and the ground."""

    terrain: Terrain
    bodies: list[Body]
    people: People  # the bodies that are people, whose parts move
    ego: Path  # motion of the sensor's carrier
    height_m: float  # height of the sensor above the ground
    sway_rad: float  # amplitude of the carrier's roll and pitch
    mount_rad: Pair  # roll and pitch of the sensor on its carrier
    gait: Gait | None = None  # gait of the carrier; None for wheels
    T_carrier_sensor: Float64 | None = None  # (4, 4) further mount, of one of several sensors

    def __post_init__(self) -> None:
        at_rest = np.array([body.path.at_rest for body in self.bodies], np.bool_)
        self._moving = np.flatnonzero(~at_rest).tolist()
        self._start = np.zeros((len(at_rest), 5))
        self._start[:, [0, 1, 3]] = np.array([body.path.at(0.0) for body in self.bodies]).reshape(-1, 3)
        self._start[:, 2] = self.terrain.heights(self._start[:, 0], self._start[:, 1])
        self._static = self._placed(self._rigid_parts(np.flatnonzero(at_rest).tolist()), self._start)
        self._rigid = self._rigid_parts(self._moving)

    def ego_pose(self, time_s: float) -> Float64:
        """(4, 4) T_world_sensor."""
        x, y, yaw = self.ego.at(time_s)
        c = np.cos(yaw)
        s = np.sin(yaw)
        # slope of the ground under the carrier, between its axles and between its wheels
        rise = self._smooth(x + 1.3 * c, y + 1.3 * s) - self._smooth(x - 1.3 * c, y - 1.3 * s)
        bank = self._smooth(x - 0.8 * s, y + 0.8 * c) - self._smooth(x + 0.8 * s, y - 0.8 * c)
        pitch = self.mount_rad[1] - np.arctan2(rise, 2.6) + self.sway_rad * np.sin(2.9 * time_s)
        roll = self.mount_rad[0] + np.arctan2(bank, 1.6) + self.sway_rad * np.sin(2.1 * time_s + 1.0)
        T = se3(rotation_zyx(float(roll), float(pitch), yaw), np.array([x, y, self._smooth(x, y) + self.height_m]))
        if self.gait is not None:
            T = T @ self.gait.pose(time_s)
        return T if self.T_carrier_sensor is None else T @ self.T_carrier_sensor

    def poses(self, time_s: float) -> Float64:
        """(n, 5) of each body x, y, z on the ground [m, world], heading [rad], speed [m/s]."""
        out = self._start.copy()
        for i in self._moving:
            path = self.bodies[i].path
            out[i, [0, 1, 3]] = path.at(time_s)
            out[i, 4] = path.speed(time_s)
        out[self._moving, 2] = self.terrain.heights(out[self._moving, 0], out[self._moving, 1])
        return out

    def boxes(self, time_s: float) -> Float64:
        """(n, 7) box of each body, world frame."""
        pose = self.poses(time_s)
        size = np.array([b.size for b in self.bodies]).reshape(-1, 3)
        return np.column_stack([pose[:, :3] + size * [0, 0, 0.5], size, pose[:, 3]])

    def solids(self, time_s: float, T_world_sensor: Float64, reach_m: float) -> Solids:
        """Solids within reach of the sensor at a time, sensor frame."""
        poses = self.poses(time_s)
        distance = np.hypot(*(poses[self.people["body"], :2] - T_world_sensor[:2, 3]).T)
        people = people_solids(self.people[distance < reach_m], time_s)
        moving = self._placed(Solids.join([self._rigid, people]), poses)
        near = [self._near(solids, T_world_sensor, reach_m) for solids in (self._static, moving)]
        T = inverse(T_world_sensor)
        return Solids.join(near).transformed(T[:3, :3], T[:3, 3])

    def _rigid_parts(self, which: list[int]) -> Solids:
        """Rigid parts of some bodies, body frames."""
        return Solids.join(self.bodies[i].solids.of(i) for i in which)

    def _near(self, solids: Solids, T_world_sensor: Float64, reach_m: float) -> Solids:
        distance = np.hypot(*(solids.centre[:, :2] - T_world_sensor[:2, 3].astype(np.float32)).T)
        return solids.take(distance < reach_m + np.linalg.norm(solids.half[:, :2], axis=1))

    @staticmethod
    def _placed(solids: Solids, poses: Float64) -> Solids:
        """Solids from their body frames to the world frame."""
        c = np.cos(poses[:, 3])
        s = np.sin(poses[:, 3])
        R = np.zeros((len(poses), 3, 3), np.float32)
        R[:, 0, 0] = R[:, 1, 1] = c
        R[:, 0, 1] = -s
        R[:, 1, 0] = s
        R[:, 2, 2] = 1
        return solids.transformed(R[solids.body], poses[solids.body, :3])

    def _smooth(self, x: float, y: float) -> float:
        """Height of the ground, averaged over 1 m [m]."""
        offsets = np.array([-0.5, 0.0, 0.5], np.float32)
        cell = self.terrain.cells(np.float32(x) + offsets[:, None], np.float32(y) + offsets)
        return float(self.terrain.height.ravel()[cell].mean())
