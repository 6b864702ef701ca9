"""Convex solids: the parts of every body."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import ArrayLike

from modt.types import Bool, Float32, Float64, Int, Self

N_CUTS = 4
"""Number of cutting planes of a solid."""
NARROW_M = 0.3
"""Half the least side below which the width of the beam matters."""
EYE: Float32 = np.eye(3, dtype=np.float32)
NO_CUTS: Float32 = np.tile(np.array([0, 0, 0, 1], np.float32), (1, N_CUTS, 1))


@dataclass(frozen=True)
class Solids:
    """n convex solids: each the intersection of a box, half-spaces and a quadric.

    A point u in the frame of a solid belongs to it where |u| <= half on every axis, sum(quadric * u^2) <= 1 and
    cut[:3] . u <= cut[3] for every cut: boxes, wedges, ellipsoids, cylinders.
    """

    rotation: Float32  # (n, 3, 3) from the frame of the solid to that of the body, the world or the sensor
    centre: Float32  # (n, 3) of the box, in that frame [m]
    half: Float32  # (n, 3) half the sides of the box [m]
    quadric: Float32  # (n, 3) inverse squared semi-axes [1/m2]; zero along unbounded axes
    cuts: Float32  # (n, N_CUTS, 4) outward normal and distance of the cutting planes; normal zero for none
    density: Float32  # (n,) extinction [1/m]: infinite for a surface, finite for foliage
    material: Int  # (n,) its Material
    body: Int  # (n,) index of its body

    def __len__(self) -> int:
        return len(self.centre)

    def take(self, rows: Int | Bool) -> Self:
        """The solids at some rows."""
        return type(self)(*(getattr(self, f.name)[rows] for f in fields(self)))

    def of(self, body: int) -> Self:
        """Copy of the solids as parts of a body."""
        return replace(self, body=np.full(len(self), body, np.int64))

    def transformed(self, rotation: Float32 | Float64, translation: Float32 | Float64) -> Self:
        """The solids after a rigid transform, one for all or one each."""
        R = np.asarray(rotation, np.float32)
        centre = (R @ self.centre[:, :, None])[:, :, 0] + np.asarray(translation, np.float32)
        return replace(self, rotation=R @ self.rotation, centre=centre)

    def widened_by_beam(self, radius_m: float, divergence_rad: float) -> Self:
        """Solids, sensor frame, with narrow opaque ones widened by the beam, which returns from their edges."""
        narrow = (self.half.min(axis=1) < NARROW_M) & ~np.isfinite(self.density)
        beam_m = np.float32(radius_m) + np.float32(divergence_rad) * np.linalg.norm(self.centre, axis=1)
        more = np.where(narrow, beam_m, 0)[:, None]
        with np.errstate(divide="ignore"):
            semi = 1 / np.sqrt(self.quadric)
        quadric = np.where(self.quadric > 0, 1 / np.square(semi + more), 0)
        cuts = self.cuts.copy()
        cuts[:, :, 3] += more
        half = (self.half + more).astype(np.float32)
        return replace(self, half=half, quadric=quadric.astype(np.float32), cuts=cuts)

    @classmethod
    def join(cls, groups: Iterable[Self]) -> Self:
        """Join all groups into one, in order."""
        listed = list(groups) or [cls.none()]
        return cls(*(np.concatenate([getattr(g, f.name) for g in listed]) for f in fields(cls)))

    @classmethod
    def none(cls) -> Self:
        """No solids."""
        return cls.make(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)), 0)

    @classmethod
    def make(
        cls,
        centre: Float64,
        half: Float64,
        quadric: Float64,
        material: int,
        rotation: ArrayLike = EYE,
        body: ArrayLike = 0,
        density: float = np.inf,
    ) -> Self:
        """Solids without cuts; columns (n, 3), one material and density, one rotation and body for all or each."""
        n = len(centre)
        return cls(
            rotation=np.tile(np.asarray(rotation, np.float32), (n if np.ndim(rotation) == 2 else 1, 1, 1)),
            centre=centre.astype(np.float32),
            half=half.astype(np.float32),
            quadric=quadric.astype(np.float32),
            cuts=NO_CUTS.repeat(n, axis=0),
            density=np.full(n, density, np.float32),
            material=np.full(n, material, np.int64),
            body=np.broadcast_to(np.asarray(body, np.int64), n).copy(),
        )


Pair = tuple[float, float]
Triple = tuple[float, float, float]


def box(centre: Triple, size: Triple, material: int, yaw: float = 0.0, density: float = np.inf) -> Solids:
    """An upright box of (length, width, height) [m]; of foliage where the density [1/m] is finite."""
    R = [[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]]
    return Solids.make(np.array([centre]), np.array([size]) / 2, np.zeros((1, 3)), material, R, density=density)


def block(size: Triple, material: int, x: float = 0.0, y: float = 0.0, density: float = np.inf) -> Solids:
    """An upright box of (length, width, height) that stands on the ground at x, y [m]."""
    return box((x, y, size[2] / 2), size, material, density=density)


def wedge(centre: Triple, size: Triple, material: int, cuts: list[tuple[float, float, float, float]]) -> Solids:
    """A box cut by planes a u_x + b u_y + c u_z <= d in its frame."""
    solid = box(centre, size, material)
    for i, (a, b, c, d) in enumerate(cuts):
        solid.cuts[0, i] = np.array([a, b, c, d]) / float(np.sqrt(a * a + b * b + c * c))
    return solid


def rounded(solids: Solids, semi: Triple) -> Solids:
    """The solids, in place, inside an ellipsoid about their centre; unbounded along infinite semi-axes [m]."""
    solids.quadric[:] = np.array(semi) ** -2.0
    return solids


def ellipsoid(centre: Triple, semi: Triple, material: int, density: float = np.inf) -> Solids:
    """An ellipsoid by its semi-axes [m]; of foliage where the density [1/m] is finite."""
    axes = np.array([semi])
    return Solids.make(np.array([centre]), axes, axes**-2.0, material, density=density)


def cylinder(centre: Triple, radius: float, length: float, material: int, axis: int = 2) -> Solids:
    """A round cylinder along an axis of the body."""
    half = np.full((1, 3), radius)
    half[0, axis] = length / 2
    quadric = np.full((1, 3), radius**-2.0)
    quadric[0, axis] = 0.0  # unbounded along the axis, where the box ends it
    return Solids.make(np.array([centre]), half, quadric, material)


def rod(start: Triple, end: Triple, radius: float, material: int) -> Solids:
    """A round cylinder between two points."""
    along = np.subtract(end, start)
    length = float(np.linalg.norm(along))
    z = along / length
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.9 else [1.0, 0.0, 0.0], z)
    x /= np.linalg.norm(x)
    solid = cylinder((0.0, 0.0, 0.0), radius, length, material)
    return solid.transformed(np.stack([x, np.cross(z, x), z], axis=1), np.add(start, end) / 2)
