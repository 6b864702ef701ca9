"""What a frame's proposals show, in the world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.geometry import transform, transform_boxes
from modt.geometry.kdop import WAYS, middles, outlines
from modt.types import Bool, Float64, Int, Proposals


@dataclass(frozen=True, slots=True)
class Sightings:
    """The proposals of a frame in the world; P rows.

    Attributes:
        box: (P, 7) world frame.
        centroid: (P, 2) mean of the points [m].
        outline: (8, P) of the points, see outlines.py [m].
        foot, top: (P,) heights of the lowest and the highest point [m].
        count: (P,) points.
        range_m: (P,) distance from the sensor.
        cut: (P,) the outline is cut short by the field of view or by something in front.
        eye: (2,) where the sensor stands [m].
    """

    box: Float64
    centroid: Float64
    outline: Float64
    foot: Float64
    top: Float64
    count: Int
    range_m: Float64
    cut: Bool
    eye: Float64

    def __len__(self) -> int:
        return len(self.box)

    @property
    def place(self) -> Float64:
        """(P, 2) middle of the outline along x and y [m]."""
        return middles(self.outline)[::2].T

    def moved(self, step: Float64) -> Sightings:
        """Each of them where it is after a step (P, 2) [m, world]."""
        box = self.box.copy()
        box[:, :2] += step
        return Sightings(
            box=box,
            centroid=self.centroid + step,
            outline=self.outline + WAYS.T @ step.T,
            foot=self.foot,
            top=self.top,
            count=self.count,
            range_m=self.range_m,
            cut=self.cut,
            eye=self.eye,
        )

    def take(self, rows: Int) -> Sightings:
        """A copy of the rows given."""
        return Sightings(
            box=self.box.take(rows, axis=0),
            centroid=self.centroid.take(rows, axis=0),
            outline=self.outline.take(rows, axis=1),
            foot=self.foot[rows],
            top=self.top[rows],
            count=self.count[rows],
            range_m=self.range_m[rows],
            cut=self.cut[rows],
            eye=self.eye,
        )

    def put(self, rows: Int, few: Sightings) -> None:
        """Write others over the rows given."""
        self.box[rows], self.centroid[rows], self.outline[:, rows] = few.box, few.centroid, few.outline
        self.foot[rows], self.top[rows], self.count[rows] = few.foot, few.top, few.count
        self.range_m[rows], self.cut[rows] = few.range_m, few.cut


def sight(proposals: Proposals, T_world_sensor: Float64) -> Sightings:
    """A frame's proposals, taken to the world by T_world_sensor (4, 4)."""
    box = transform_boxes(T_world_sensor, proposals.box)
    return Sightings(
        box=box,
        centroid=transform(T_world_sensor, proposals.centroid)[:, :2],
        outline=outlines(proposals, T_world_sensor),
        foot=box[:, 2] - box[:, 5] / 2,
        top=box[:, 2] + box[:, 5] / 2,
        count=proposals.count,
        range_m=np.hypot(proposals.centroid[:, 0], proposals.centroid[:, 1]),
        cut=proposals.truncated | proposals.occluded,
        eye=T_world_sensor[:2, 3],
    )
