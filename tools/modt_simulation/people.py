"""Articulated people: walking, standing, sitting and cycling."""

from __future__ import annotations

from dataclasses import dataclass, fields
from enum import IntEnum

import numpy as np

from modt.types import Bool, Float64, Int
from modt_simulation.materials import Material
from modt_simulation.solids import Solids


class Posture(IntEnum):
    """Posture of a person."""

    STAND = 0
    WALK = 1
    RIDE = 2
    SIT = 3


SADDLE_M, CRANK_M = 0.93, np.array([0.08, 0.0, 0.3])
"""Height of the saddle and position of the crank of a bicycle."""


@dataclass(frozen=True)
class People:
    """n people."""

    body: Int  # (n,) index of the body
    posture: Int  # (n,) Posture
    height: Float64  # (n,) standing height [m]
    girth: Float64  # (n,) breadth relative to the mean
    phase: Float64  # (n,) of the gait at time 0 [rad]
    rate: Float64  # (n,) of the gait [rad/s]
    stride: Float64  # (n,) amplitude of a foot along the walk [m]
    coat: Float64  # (n,) breadth of a coat or skirt at the hips [m]; about zero for none
    pack: Float64  # (n,) depth of a backpack [m]; about zero for none
    strip: Float64  # (n,) height of a retroreflective strip around the chest [m]; zero for none

    def take(self, rows: Int | Bool) -> People:
        """The people at some rows."""
        return People(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})

    def solids(self, time_s: float) -> Solids:
        """Their solids at a time, body frames (x ahead, z up, origin on the ground)."""
        n = len(self.body)
        if not n:
            return Solids.none()
        H, g = self.height, self.girth
        swing = self.phase + self.rate * time_s
        ride, walk, sit = (self.posture == p for p in (Posture.RIDE, Posture.WALK, Posture.SIT))
        hip_z = np.where(ride, SADDLE_M, np.where(sit, 0.47, 0.52 * H))
        hip_x = np.where(ride, -0.22, 0.0)
        lean = np.where(ride, 0.55, np.where(walk, 0.06, 0.02))
        spine = 0.30 * H
        hips = _points(hip_x, 0.0, hip_z)
        neck = hips + _points(spine * np.sin(lean), 0.0, spine * np.cos(lean))
        head = neck + _points(0.02 + 0.3 * lean * 0.2, 0.0, 0.115 * H)
        bars: list[tuple[Float64, Float64, Float64, Float64, int]] = []
        for side in (1.0, -1.0):
            turn = swing + (0.0 if side > 0 else np.pi)
            hip = hips + _points(0.0, side * 0.085 * g, 0.0)
            foot_walk = _points(self.stride * np.sin(turn), 0.0, 0.05 + 0.10 * np.maximum(np.cos(turn), 0))
            foot_stand = _points(0.05 * np.sin(self.phase), 0.0, 0.05)
            foot_ride = CRANK_M + 0.17 * _points(np.cos(turn), 0.0, -np.sin(turn))
            foot_sit = _points(0.42, 0.0, 0.06)
            foot = _choose(self.posture, foot_stand, foot_walk, foot_ride, foot_sit)
            foot[:, 1] = side * 0.09 * g
            knee, foot = _bend(hip, foot, 0.245 * H, 0.245 * H, +1.0)
            shoulder = neck + _points(-0.01, side * 0.185 * g, -0.03 * H)
            hand_walk = _points(0.10 - 0.75 * self.stride * np.sin(turn), 0.0, 0.47 * H)
            hand_stand = _points(0.06 + 0.12 * np.sin(2 * self.phase), 0.0, 0.47 * H + 0.1 * np.cos(self.phase) ** 2)
            hand_ride = _points(0.46, 0.0, 1.02)
            hand_sit = _points(0.3, 0.0, 0.62)
            hand = _choose(self.posture, hand_stand, hand_walk, hand_ride, hand_sit)
            hand[:, 1] = side * np.where(ride | sit, 0.24, 0.25 * g)
            elbow, hand = _bend(shoulder, hand, 0.175 * H, 0.16 * H, -1.0)
            toe = foot + _points(0.17, 0.0, -0.01)
            bars += [
                (hip, knee, 0.085 * g, 0.085 * g, Material.CLOTH),
                (knee, foot, 0.058 * g, 0.058 * g, Material.CLOTH),
                (foot, toe, 0.045 + 0 * g, 0.045 + 0 * g, Material.RUBBER),
                (shoulder, elbow, 0.052 * g, 0.052 * g, Material.CLOTH),
                (elbow, hand, 0.04 * g, 0.04 * g, Material.SKIN),
            ]
        hem = hips + _points(np.where(ride | sit, 0.05, 0.0), 0.0, -0.22 * H * np.where(ride | sit, 0.3, 1.0))
        back = (hips + 2 * neck) / 3 - _points(0.13 * g, 0.0, 0.0)
        up = 0.2 * (neck - hips) / spine[:, None]
        bars += [
            (hips - _points(0.0, 0.0, 0.06), neck, 0.125 * g, 0.19 * g, Material.CLOTH),
            (hem, hips + _points(0.02, 0.0, 0.1), 0.8 * self.coat, self.coat, Material.CLOTH),
            (back - up, back + up, self.pack, np.minimum(1.6 * self.pack, 0.16), Material.CLOTH),
            (neck - _points(0.0, 0.0, 0.02), head, 0.055 + 0 * g, 0.055 + 0 * g, Material.SKIN),
        ]
        skull = np.tile([0.1, 0.08, 0.12], (n, 1))
        worn = self.strip > 0
        chest, half = (0.45 * hips + 0.55 * neck)[worn], (2.5 * up * self.strip[:, None])[worn]
        strip = _bars(chest - half, chest + half, 0.135 * g[worn], 0.2 * g[worn], Material.RETRO, self.body[worn])
        skulls = Solids.make(head, skull, skull**-2.0, Material.SKIN, body=self.body)
        return Solids.join([*(_bars(*bar, body=self.body) for bar in bars), skulls, strip])


def _points(x: Float64 | float, y: Float64 | float, z: Float64 | float) -> Float64:
    return np.stack(np.broadcast_arrays(*np.atleast_1d(x, y, z)), axis=1)


def _choose(posture: Int, *options: Float64) -> Float64:
    full = np.stack([np.broadcast_to(o, (len(posture), 3)) for o in options])
    return full[posture, np.arange(len(posture))]


def _bend(root: Float64, tip: Float64, upper: Float64, lower: Float64, side: float) -> tuple[Float64, Float64]:
    """Middle joint of a limb of two bars, bent forward (+1) or backward (-1), and its tip limited to the reach."""
    along = tip - root
    length = np.linalg.norm(along, axis=1)
    reach = np.minimum(length, 0.995 * (upper + lower))
    unit = along / length[:, None]
    part = (upper**2 - lower**2 + reach**2) / (2 * reach)
    rise = np.sqrt(np.maximum(upper**2 - part**2, 0.0))
    normal = np.cross([0.0, 1.0, 0.0], unit) * -side
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return root + part[:, None] * unit + rise[:, None] * normal, root + reach[:, None] * unit


def _bars(start: Float64, end: Float64, depth: Float64, breadth: Float64, material: int, body: Int) -> Solids:
    """Elliptic cylinders between points."""
    along = end - start
    length = np.linalg.norm(along, axis=1)
    z = along / length[:, None]
    y = np.array([0.0, 1.0, 0.0]) - z[:, 1:2] * z
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    semi = np.stack([depth, breadth], axis=1)
    half, quadric = np.column_stack([semi, length / 2]), np.column_stack([semi**-2.0, np.zeros(len(body))])
    return Solids.make((start + end) / 2, half, quadric, material, np.stack([np.cross(y, z), y, z], axis=2), body)
