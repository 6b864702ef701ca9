"""Boxes of whole objects, from what their proposals show (docs/object-boxes.md).

A frame shows one or two faces of an object. The box of a track is an estimate of the whole. Its heading follows the
motion, or the rectangle fitted to the points where the object stands. Its size is the usual one of the class,
corrected by the sides that were seen whole. Its centre lies beyond the visible faces, as seen from the sensor.

Headings are unit vectors, so no angle is wrapped, and compiled code gives the same bytes.
"""

from __future__ import annotations

import numpy as np

from modt.geometry.kernels import NUMPY_GEOMETRY, GeometryKernels
from modt.object_box.centre import whole_centre
from modt.object_box.heading import neighbour_headings, turn_headings, which_move
from modt.object_box.rectangles import extent, fitted
from modt.object_box.seen import Seen, bottom_and_height, forward_of, in_sensor, in_world
from modt.object_box.size import whole_size_m
from modt.object_box.tuning import ObjectBoxTuning
from modt.placement import Placement
from modt.types import Decisions, Float64, Int, Motion, ObjectBoxes, Proposals


class SeenBoxes:
    """Takes the box last seen for that of the whole object, as in the paper."""

    def estimate(
        self, own: ObjectBoxes, motion: Motion, decisions: Decisions, proposals: Proposals, placement: Placement
    ) -> None:
        """Write the box of every track."""
        own.whole_box[:] = motion.box


class WholeBoxes(SeenBoxes):
    """Estimates the boxes of tracks that are reported as objects; the others have the box last seen.

    Args:
        kernels: passes over points.
        tuning: everything that is chosen in the stage.
    """

    def __init__(
        self, kernels: GeometryKernels = NUMPY_GEOMETRY, tuning: ObjectBoxTuning = ObjectBoxTuning()
    ) -> None:
        self._kernels = kernels
        self.tuning = tuning

    def estimate(
        self, own: ObjectBoxes, motion: Motion, decisions: Decisions, proposals: Proposals, placement: Placement
    ) -> None:
        """Write the box of every track.

        Args:
            own: written.
            motion: the tracks as the tracker leaves them.
            decisions: reported classes.
            proposals: proposals of the frame.
            placement: pose of the sensor.
        """
        rows = ((decisions.object_class > 0) & motion.observed).nonzero()[0]
        neighbour = neighbour_headings(own, motion, decisions.object_class, self.tuning.heading)
        self._estimate(own, motion, decisions.object_class, neighbour, proposals, placement.T_world_sensor, rows)
        heading = own.heading.take(rows, axis=0)
        own.whole_box[rows, 6] = np.arctan2(heading[:, 1], heading[:, 0])

    def _estimate(
        self,
        own: ObjectBoxes,
        motion: Motion,
        object_class: Int,
        neighbour: Float64,
        proposals: Proposals,
        T_world_sensor: Float64,
        rows: Int,
    ) -> None:
        """Write the columns of all tracks, but the yaw of the objects in view, whose rows (R,) are given.

        The other arrays are of all tracks: their classes (M,) and the headings of their neighbours (M, 2).
        """
        others = (object_class == 0).nonzero()[0]
        own.whole_box[others] = motion.box.take(others, axis=0)
        lost = ((object_class > 0) & ~motion.observed & own.estimated).nonzero()[0]
        own.whole_box[lost, :2] = motion.x[lost, :2] + own.centre_offset[lost]
        if not len(rows):
            return
        state = own.renewed(rows, 0)
        of_rows = motion.proposal[rows]
        forward = forward_of(T_world_sensor)
        long_side, sides_m = fitted(proposals, of_rows, forward, self._kernels, self.tuning.heading)
        seen = Seen(
            rows,
            object_class[rows],
            of_rows,
            motion.box.take(rows, axis=0),
            long_side,
            sides_m,
            neighbour[rows],
            which_move(motion, rows, self.tuning.heading),
            forward,
        )
        turn_headings(state, motion, seen, self.tuning.heading)
        middle, extent_m = self._visible(state, seen, proposals, T_world_sensor)
        bottom, extent_m[:, 2] = bottom_and_height(seen, proposals, T_world_sensor)
        size_m = whole_size_m(state, seen, extent_m, self.tuning.size)
        centre = whole_centre(
            state, motion, seen, proposals, T_world_sensor, middle, extent_m, size_m, self.tuning.centre
        )
        state.centre_offset[:] = centre - motion.x[rows, :2]
        state.estimated[:] = True
        state.whole_box[:, :6] = np.column_stack([centre, bottom + size_m[:, 2] / 2, size_m])
        for name, column in state.columns().items():
            getattr(own, name)[rows] = column

    def _visible(
        self, state: ObjectBoxes, seen: Seen, proposals: Proposals, T_world_sensor: Float64
    ) -> tuple[Float64, Float64]:
        """Rectangles about the proposals at the headings.

        Returns:
            middle: (R, 2) middle of each [m, world].
            extent_m: (R, 3) extent along the heading, across it, and 0 [m].
        """
        c, s = in_sensor(state.heading, seen.forward)
        low, high = extent(proposals, seen.proposal, np.stack([c, s], axis=1), self._kernels)
        u, v = (low + high) / 2
        length_m, width_m = high - low
        middle = np.stack([u * c - v * s, u * s + v * c], axis=1)
        extent_m = np.stack([length_m, width_m, np.zeros(len(u))], axis=1)
        return in_world(seen, proposals, middle, T_world_sensor), extent_m
