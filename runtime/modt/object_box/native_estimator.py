"""`WholeBoxes` in C (`modt.native`)."""

from __future__ import annotations

import ctypes

import numpy as np

from modt.class_sizes import IS_PERSON, IS_WALKER, MAX_SIZE_M, USUAL_SIZE_M, USUAL_SPREAD_M
from modt.classes import N_CLASSES
from modt.geometry.kernels import GeometryKernels
from modt.native.declarations import declare, structure
from modt.object_box.estimator import WholeBoxes
from modt.object_box.rectangles import HEADINGS, SIDES
from modt.object_box.seen import forward_of
from modt.object_box.tuning import ObjectBoxTuning
from modt.types import Float64, Int, Motion, ObjectBoxes, Proposals

_COLUMNS = structure("ObjectBoxColumns")
_PROPOSALS = structure("VisibleProposals")
_FIT = structure("FitHeadings")
_SIZES = structure("ClassSizes")
_OF_THE_TRACKER = "box", "x", "velocity", "moved_m", "proposal", "motion"
"""Columns that the tracker owns."""


class NativeWholeBoxes(WholeBoxes):
    """`WholeBoxes` in C."""

    def __init__(self, library: ctypes.CDLL, tuning: ObjectBoxTuning) -> None:
        super().__init__(tuning=tuning)
        declare(library, "object_box.c")
        self._library = library
        self._fit_headings = _FIT(heading=HEADINGS, sides=SIDES, n=len(HEADINGS))
        self._sizes = _SIZES(
            usual_m=USUAL_SIZE_M,
            spread_m=USUAL_SPREAD_M,
            max_m=MAX_SIZE_M,
            is_person=IS_PERSON,
            is_walker=IS_WALKER,
            n_classes=N_CLASSES,
        )
        self._parts = (
            structure("HeadingTuning").of(tuning.heading),
            structure("SizeTuning").of(tuning.size),
            structure("CentreTuning").of(tuning.centre),
        )

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
        """The same."""
        columns = {name: getattr(motion, name) for name in _OF_THE_TRACKER}
        columns["velocity_covariance"] = motion.velocity_covariance.reshape(-1, 4)
        ground_z_m = proposals.ground_z_m
        forward_x, forward_y = forward_of(T_world_sensor)
        self._library.modt_object_boxes(
            _COLUMNS.of(own, **columns, object_class=object_class, neighbour=neighbour, m=len(own)),
            _PROPOSALS.of(
                proposals,
                ground_z_m=np.full(len(proposals), np.inf) if ground_z_m is None else ground_z_m,
                T_world_sensor=np.ascontiguousarray(T_world_sensor),
                n=len(proposals),
                forward_x=forward_x,
                forward_y=forward_y,
            ),
            self._fit_headings,
            self._sizes,
            *self._parts,
        )


def whole_boxes_of(kernels: GeometryKernels, tuning: ObjectBoxTuning = ObjectBoxTuning()) -> WholeBoxes:
    """The estimator: native if the kernels have a library, else in NumPy."""
    return WholeBoxes(kernels, tuning) if kernels.library is None else NativeWholeBoxes(kernels.library, tuning)
