"""Convex pieces: what every body of the synthetic world is made of."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from modt.types import Bool, Float32, Float64, Int

CUTS = 4
"""Cutting planes a piece may have beside its box."""

NARROW_M = 0.3
"""Half the least side of a piece that a beam may graze on both sides."""

SOLID = np.float32(np.inf)
NO_CUTS: Float32 = np.tile(np.array([0, 0, 0, 1], np.float32), (1, CUTS, 1))


@dataclass(frozen=True, slots=True)
class Pieces:
    """n convex pieces, each a box, shaved by cutting planes, inside a quadric.

    A point u of a piece's own frame belongs to it where |u| <= half on every axis, sum(quadric * u^2) <= 1 and
    cut[:3] . u <= cut[3] for every cut. That makes boxes, wedges, ellipsoids, cylinders and limbs.

    Attributes:
        rotation: (n, 3, 3) own frame to the body's, the world's or the sensor's.
        centre: (n, 3) of the box, in that frame [m].
        half: (n, 3) half sides of the box [m].
        quadric: (n, 3) inverse squared semi-axes [1/m2]; zero where an axis is not bounded by it.
        cuts: (n, CUTS, 4) outward normal and distance of the cutting planes; normal zero where there is none.
        density: (n,) extinction [1/m]: infinite for a solid surface, finite for foliage.
        material: (n,) row in the table of materials.
        body: (n,) row in the table of bodies.
    """

    rotation: Float32
    centre: Float32
    half: Float32
    quadric: Float32
    cuts: Float32
    density: Float32
    material: Int
    body: Int

    def __len__(self) -> int:
        return len(self.centre)

    def take(self, rows: Int | Bool) -> Self:
        """The pieces given, by index or mask."""
        return type(self)(*(getattr(self, f.name)[rows] for f in fields(self)))

    def of(self, body: int) -> Self:
        """The same pieces as parts of that body."""
        return self._with(body=np.full(len(self), body, np.int64))

    def moved(self, rotation: Float32 | Float64, translation: Float32 | Float64) -> Self:
        """The pieces taken by a rigid motion, one for all or one each."""
        R = np.asarray(rotation, np.float32)
        t = np.asarray(translation, np.float32)
        centre = (R @ self.centre[:, :, None])[:, :, 0] + t
        return self._with(rotation=R @ self.rotation, centre=centre)

    def as_met(self, spot_m: float, divergence_rad: float) -> Self:
        """The pieces, in the sensor frame, as a beam of some breadth meets them.

        A beam returns from what it only grazes: narrow solid pieces look broader by the radius of the beam.
        """
        away = np.linalg.norm(self.centre, axis=1)
        narrow = (self.half.min(axis=1) < NARROW_M) & ~np.isfinite(self.density)
        more = np.where(narrow, np.float32(spot_m) + np.float32(divergence_rad) * away, 0)[:, None]
        with np.errstate(divide="ignore"):
            semi = 1 / np.sqrt(self.quadric)
        quadric = np.where(self.quadric > 0, 1 / np.square(semi + more), 0)
        cuts = self.cuts.copy()
        cuts[:, :, 3] += more
        return self._with(half=(self.half + more).astype(np.float32), quadric=quadric.astype(np.float32), cuts=cuts)

    def _with(self, **columns: Float32 | Int) -> Self:
        return type(self)(*(columns.get(f.name, getattr(self, f.name)) for f in fields(self)))

    @classmethod
    def join(cls, groups: Iterable[Self]) -> Self:
        """All of them, in order."""
        listed = list(groups) or [cls.none()]
        return cls(*(np.concatenate([getattr(g, f.name) for g in listed]) for f in fields(cls)))

    @classmethod
    def none(cls) -> Self:
        """No pieces."""
        return cls._make(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)), 0, 0.0)

    @classmethod
    def _make(cls, centre: Float64, half: Float64, quadric: Float64, material: int, yaw: float) -> Self:
        n = len(centre)
        R = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]], np.float32)
        return cls(
            rotation=R[None].repeat(n, axis=0),
            centre=centre.astype(np.float32),
            half=half.astype(np.float32),
            quadric=quadric.astype(np.float32),
            cuts=NO_CUTS.repeat(n, axis=0),
            density=np.full(n, SOLID, np.float32),
            material=np.full(n, material, np.int64),
            body=np.zeros(n, np.int64),
        )


Triple = tuple[float, float, float]


def box(centre: Triple, size: Triple, material: int, yaw: float = 0.0) -> Pieces:
    """An upright box of (length, width, height) [m]."""
    return Pieces._make(np.array([centre]), np.array([size]) / 2, np.zeros((1, 3)), material, yaw)


def wedge(centre: Triple, size: Triple, material: int, cuts: list[tuple[float, float, float, float]]) -> Pieces:
    """A box shaved by planes a u_x + b u_y + c u_z <= d of its own frame."""
    made = box(centre, size, material)
    for i, (a, b, c, d) in enumerate(cuts):
        norm = float(np.sqrt(a * a + b * b + c * c))
        made.cuts[0, i] = np.array([a, b, c, d]) / norm
    return made


def rounded(made: Pieces, semi: Triple) -> Pieces:
    """The same pieces inside an ellipsoid about their middle; an infinite semi-axis [m] does not bound them."""
    made.quadric[:] = np.array(semi) ** -2.0
    return made


def ellipsoid(centre: Triple, semi: Triple, material: int, density: float | None = None) -> Pieces:
    """An ellipsoid by its semi-axes [m]; of foliage where a density [1/m] is given."""
    axes = np.array([semi])
    made = Pieces._make(np.array([centre]), axes, axes**-2.0, material, 0.0)
    if density is not None:
        made.density[:] = density
    return made


def cylinder(centre: Triple, radius: float, length: float, material: int, axis: int = 2) -> Pieces:
    """A round cylinder along an axis of the body."""
    half, quadric = np.full((1, 3), radius), np.full((1, 3), radius**-2.0)
    half[0, axis], quadric[0, axis] = length / 2, 0.0
    return Pieces._make(np.array([centre]), half, quadric, material, 0.0)


def bush(centre: Triple, size: Triple, material: int, density: float, yaw: float = 0.0) -> Pieces:
    """A box of foliage: a hedge."""
    made = box(centre, size, material, yaw)
    made.density[:] = density
    return made


def limb(start: Triple, end: Triple, radius: float, material: int) -> Pieces:
    """A round bar between two points."""
    a, b = np.array(start), np.array(end)
    along = b - a
    length = float(np.linalg.norm(along))
    z = along / length
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.9 else [1.0, 0.0, 0.0], z)
    x /= np.linalg.norm(x)
    made = cylinder((0.0, 0.0, 0.0), radius, length, material)
    return made.moved(np.stack([x, np.cross(z, x), z], axis=1), (a + b) / 2)
