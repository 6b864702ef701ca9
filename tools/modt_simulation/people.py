"""Articulated people: walking, standing, cycling, sitting, crouching, kneeling and lying."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from modt.types import Float64, Int
from modt_simulation.materials import Material
from modt_simulation.solids import Solids


class Posture(IntEnum):
    """Posture of a person."""

    STAND = 0
    WALK = 1
    RIDE = 2
    SIT = 3
    FLOOR = 4
    """Sits on the floor with straight legs."""
    CROUCH = 5
    KNEEL = 6
    LIE = 7
    """Lies on the back."""


LEAN_RAD = np.array([0.02, 0.06, 0.55, 0.02, -0.1, 0.5, 0.1, -1.55])
"""Lean of the trunk in each posture."""
BENT_RAD = 0.9
"""Lean of the trunk above which the head is in line with it; below, it is upright."""
SADDLE_M = 0.93
"""Height of the saddle of a bicycle."""
CRANK_M = np.array([0.08, 0.0, 0.3])
"""Position of its crank."""


class Person(NamedTuple):
    """Properties of a person that stay the same over a scene."""

    body: int  # index of the body
    posture: Posture
    height: float  # standing height [m]
    girth: float  # breadth relative to the mean
    phase: float  # phase of the gait at time 0 [rad]
    rate: float  # rate of the gait [rad/s]
    stride: float  # amplitude of a foot along the walk [m]
    coat: float  # breadth of a coat or skirt at the hips [m]; about zero for none
    pack: float  # depth of a backpack [m]; about zero for none
    strip: float  # height of a retroreflective strip around the chest [m]; zero for none
    # Differences from the joints of the posture.
    lean: float = 0.0  # of the trunk [rad]
    hips_x: float = 0.0  # [m]
    hips_z: float = 0.0
    hands_x: float = 0.0
    hands_z: float = 0.0
    feet_x: float = 0.0
    feet_apart: float = 0.0  # of each foot from the middle [m]


PERSON = np.dtype([(name, int if name in ("body", "posture") else float) for name in Person._fields])
People = NDArray[np.void]
"""(n,) rows of PERSON."""


def people_solids(people: People, time_s: float) -> Solids:
    """The solids of n people at a time, body frames (x ahead, z up, origin on the ground)."""
    if not len(people):
        return Solids.none()
    figure = _Figures(people)
    bars = []
    for side, lag in ((1.0, 0.0), (-1.0, np.pi)):
        turn = people["phase"] + people["rate"] * time_s + lag
        bars += [*figure.leg(side, turn), *figure.arm(side, turn)]
    bars += figure.trunk()
    skull = np.tile([0.1, 0.08, 0.12], (len(people), 1))
    skulls = Solids.make(figure.head, skull, skull**-2.0, Material.SKIN, body=people["body"])
    return Solids.join([*(bar.solids(people["body"]) for bar in bars), skulls, figure.strips()])


class _Bar(NamedTuple):
    """An elliptic cylinder between two points of each of n people."""

    start: Float64  # (n, 3)
    end: Float64  # (n, 3)
    depth: Float64 | float  # (n,) semi-axis ahead [m]
    breadth: Float64 | float  # (n,) semi-axis to the side [m]
    material: Material = Material.CLOTH

    def solids(self, body: Int) -> Solids:
        """(n,) cylinders as parts of (n,) bodies."""
        along = self.end - self.start
        length = np.linalg.norm(along, axis=1)
        z = along / length[:, None]
        y = np.array([0.0, 1.0, 0.0]) - z[:, 1:2] * z
        y /= np.linalg.norm(y, axis=1, keepdims=True)
        half = _points(self.depth, self.breadth, length / 2)
        quadric = half**-2.0 * [1.0, 1.0, 0.0]
        rotation = np.stack([np.cross(y, z), y, z], axis=2)
        return Solids.make((self.start + self.end) / 2, half, quadric, self.material, rotation, body)


class _Figures:
    """Joints of n people, in the middle of the body: (n, 3) points, body frames."""

    def __init__(self, people: People) -> None:
        self.people = people
        self.height: Float64 = people["height"]
        self.girth: Float64 = people["girth"]
        self.posture: Int = people["posture"]
        ride = self.posture == Posture.RIDE
        sit = self.posture == Posture.SIT
        self.seated = ride | sit
        lean = LEAN_RAD[self.posture] + people["lean"]
        self.spine = 0.30 * self.height
        upright = _points(0.0, 0.0, 0.52 * self.height)
        self.hips = self._of_posture(
            stand=upright,
            walk=upright,
            ride=_points(-0.22, 0.0, SADDLE_M),
            sit=_points(0.0, 0.0, 0.47),
            floor=_points(-0.4, 0.0, 0.12),
            crouch=_points(-0.1, 0.0, 0.32),
            kneel=_points(0.0, 0.0, 0.48),
            lie=_points(-0.1, 0.0, 0.13),
        ) + _points(people["hips_x"], 0.0, people["hips_z"])
        self.neck = self.hips + _points(self.spine * np.sin(lean), 0.0, self.spine * np.cos(lean))
        raised = _points(0.02 + 0.3 * lean * 0.2, 0.0, 0.115 * self.height)
        in_line = 0.4 * (self.neck - self.hips)
        self.head = self.neck + np.where((np.abs(lean) > BENT_RAD)[:, None], in_line, raised)

    def leg(self, side: float, turn: Float64) -> list[_Bar]:
        """Thigh, shank and foot of the left (1) or right (-1) leg, at (n,) phases of the gait [rad]."""
        hip = self.hips + _points(0.0, side * 0.085 * self.girth, 0.0)
        foot = self._of_posture(
            stand=_points(0.05 * np.sin(self.people["phase"]), 0.0, 0.05),
            walk=_points(self.people["stride"] * np.sin(turn), 0.0, 0.05 + 0.10 * np.maximum(np.cos(turn), 0)),
            ride=CRANK_M + 0.17 * _points(np.cos(turn), 0.0, -np.sin(turn)),
            sit=_points(0.42, 0.0, 0.06),
            floor=_points(0.45, 0.0, 0.06),
            crouch=_points(0.05, 0.0, 0.06),
            kneel=_points(-0.42, 0.0, 0.06),
            lie=_points(0.75, 0.0, 0.1),
        ) + _points(self.people["feet_x"], 0.0, 0.0)
        foot[:, 1] = side * (0.09 * self.girth + self.people["feet_apart"])
        knee, foot = _bend(hip, foot, 0.245 * self.height, 0.245 * self.height, +1.0)
        toe = foot + _points(0.17, 0.0, -0.01)
        thigh = 0.085 * self.girth
        shank = 0.058 * self.girth
        return [
            _Bar(hip, knee, thigh, thigh),
            _Bar(knee, foot, shank, shank),
            _Bar(foot, toe, 0.045, 0.045, Material.RUBBER),
        ]

    def arm(self, side: float, turn: Float64) -> list[_Bar]:
        """Upper arm and forearm of the left (1) or right (-1) side, at (n,) phases of the gait [rad]."""
        phase = self.people["phase"]
        hang = 0.47 * self.height
        shoulder = self.neck + _points(-0.01, side * 0.185 * self.girth, -0.03 * self.height)
        hand = self._of_posture(
            stand=_points(0.06 + 0.12 * np.sin(2 * phase), 0.0, hang + 0.1 * np.cos(phase) ** 2),
            walk=_points(0.10 - 0.75 * self.people["stride"] * np.sin(turn), 0.0, hang),
            ride=_points(0.46, 0.0, 1.02),
            sit=_points(0.3, 0.0, 0.62),
            floor=_points(-0.5, 0.0, 0.1),
            crouch=_points(0.35, 0.0, 0.45),
            kneel=_points(0.3, 0.0, 0.7),
            lie=_points(-0.2, 0.0, 0.08),
        ) + _points(self.people["hands_x"], 0.0, self.people["hands_z"])
        hand[:, 1] = side * np.where(self.seated, 0.24, 0.25 * self.girth)
        elbow, hand = _bend(shoulder, hand, 0.175 * self.height, 0.16 * self.height, -1.0)
        upper = 0.052 * self.girth
        lower = 0.04 * self.girth
        return [_Bar(shoulder, elbow, upper, upper), _Bar(elbow, hand, lower, lower, Material.SKIN)]

    def trunk(self) -> list[_Bar]:
        """Chest, coat, backpack and neck."""
        coat = self.people["coat"]
        pack = self.people["pack"]
        fall = -0.22 * self.height * np.where(self.seated, 0.3, 1.0)
        hem = self.hips + _points(np.where(self.seated, 0.05, 0.0), 0.0, fall)
        back = (self.hips + 2 * self.neck) / 3 - _points(0.13 * self.girth, 0.0, 0.0)
        up = self._up()
        return [
            _Bar(self.hips - _points(0.0, 0.0, 0.06), self.neck, 0.125 * self.girth, 0.19 * self.girth),
            _Bar(hem, self.hips + _points(0.02, 0.0, 0.1), 0.8 * coat, coat),
            _Bar(back - up, back + up, pack, np.minimum(1.6 * pack, 0.16)),
            _Bar(self.neck - _points(0.0, 0.0, 0.02), self.head, 0.055, 0.055, Material.SKIN),
        ]

    def strips(self) -> Solids:
        """Retroreflective strips around the chests of those who wear one."""
        worn = self.people["strip"] > 0
        girth = self.girth[worn]
        chest = (0.45 * self.hips + 0.55 * self.neck)[worn]
        half = (2.5 * self._up() * self.people["strip"][:, None])[worn]
        strip = _Bar(chest - half, chest + half, 0.135 * girth, 0.2 * girth, Material.RETRO)
        return strip.solids(self.people["body"][worn])

    def _up(self) -> Float64:
        """(n, 3) steps of 0.2 m along the spine."""
        return np.asarray(0.2 * (self.neck - self.hips) / self.spine[:, None])

    def _of_posture(self, **options: Float64) -> Float64:
        """(n, 3) point of the posture of each person, by the points of all postures, (n, 3) or (1, 3)."""
        shape = (len(self.posture), 3)
        full = np.stack([np.broadcast_to(options[p.name.lower()], shape) for p in Posture])
        return full[self.posture, np.arange(len(self.posture))]


def _points(x: Float64 | float, y: Float64 | float, z: Float64 | float) -> Float64:
    """(n, 3) points, of columns or single values."""
    return np.stack(np.broadcast_arrays(*np.atleast_1d(x, y, z)), axis=1)


def _bend(root: Float64, tip: Float64, upper: Float64, lower: Float64, side: float) -> tuple[Float64, Float64]:
    """Middle joint of a limb of two bars, bent forward (+1) or backward (-1), and its tip limited to the reach."""
    along = tip - root
    length = np.linalg.norm(along, axis=1)
    unit = along / length[:, None]
    reach = np.minimum(length, 0.995 * (upper + lower))
    # The joint lies `part` along the line to the tip and `rise` off it: a triangle with three known sides.
    part = (upper**2 - lower**2 + reach**2) / (2 * reach)
    rise = np.sqrt(np.maximum(upper**2 - part**2, 0.0))
    normal = np.cross([0.0, 1.0, 0.0], unit) * -side
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return root + part[:, None] * unit + rise[:, None] * normal, root + reach[:, None] * unit
