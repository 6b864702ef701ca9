"""`WholeBoxes` in C (`modt.native`)."""

from __future__ import annotations

import ctypes
from dataclasses import fields

import numpy as np

from modt.class_sizes import IS_PERSON, IS_WALKER, MAX_SIZE_M, USUAL_SIZE_M, USUAL_SPREAD_M
from modt.classes import N_CLASSES
from modt.geometry.kernels import GeometryKernels
from modt.native.library import Array, Layout, Number, Rows, declare
from modt.object_box.estimator import HEADINGS, SIDES, WholeBoxes, forward_of
from modt.object_box.tuning import CentreTuning, HeadingTuning, ObjectBoxTuning, SizeTuning
from modt.types import Float64, Int, Motion, ObjectBoxes, Proposals

_COLUMNS = Layout(
    "ObjectBoxColumns",
    whole_box=Array(np.float64, "m", 7),
    heading=Array(np.float64, "m", 2),
    heading_variance=Array(np.float64, "m"),
    axis_evidence=Array(np.float64, "m"),
    known_m=Array(np.float64, "m", 3),
    centre_offset=Array(np.float64, "m", 2),
    heading_known=Array(np.bool_, "m"),
    estimated=Array(np.bool_, "m"),
    box=Array(np.float64, "m", 7),
    x=Array(np.float64, "m", 4),
    velocity=Array(np.float64, "m", 2),
    velocity_covariance=Array(np.float64, "m", 4),
    moved_m=Array(np.float64, "m"),
    proposal=Array(np.int64, "m"),
    motion=Array(np.int64, "m"),
    object_class=Array(np.int64, "m"),
    m=Number(np.int64),
)
_PROPOSALS = Layout(
    "VisibleProposals",
    offsets=Array(np.int64, "n_offsets"),
    coordinates=Rows(np.float32, 3, "n_points"),
    box=Array(np.float64, "n", 7),
    centroid=Array(np.float64, "n", 3),
    ground_z_m=Array(np.float64, "n"),
    T_world_sensor=Array(np.float64, 4, 4),
    n=Number(np.int64),
    forward_x=Number(np.float64),
    forward_y=Number(np.float64),
)
_FIT = Layout(
    "FitHeadings",
    heading=Array(np.float64, "n", 2),
    sides=Rows(np.float32, 2, "n_sides"),
    n=Number(np.int64),
)
_SIZES = Layout(
    "ClassSizes",
    usual_m=Array(np.float64, "n_classes", 3),
    spread_m=Array(np.float64, "n_classes", 3),
    max_m=Array(np.float64, "n_classes", 2),
    is_person=Array(np.bool_, "n_classes"),
    is_walker=Array(np.bool_, "n_classes"),
    n_classes=Number(np.int64),
)


def _tuning(kind: type[HeadingTuning | SizeTuning | CentreTuning]) -> Layout:
    """The structure of a tuning."""
    dtypes = {field.name: np.int64 if field.type == "int" else np.float64 for field in fields(kind)}
    return Layout(kind.__name__, **{name: Number(dtype) for name, dtype in dtypes.items()})


_HEADING = _tuning(HeadingTuning)
_SIZE = _tuning(SizeTuning)
_CENTRE = _tuning(CentreTuning)
_ARGUMENTS = (_COLUMNS, _PROPOSALS, _FIT, _SIZES, _HEADING, _SIZE, _CENTRE)


class NativeWholeBoxes(WholeBoxes):
    """`WholeBoxes` in C."""

    def __init__(self, library: ctypes.CDLL, tuning: ObjectBoxTuning) -> None:
        super().__init__(tuning=tuning)
        declare(library, {"modt_object_boxes": (None, _ARGUMENTS)})
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
        self._parts = _HEADING.of(tuning.heading), _SIZE.of(tuning.size), _CENTRE.of(tuning.centre)

    def _estimate(
        self,
        own: ObjectBoxes,
        motion: Motion,
        object_class: Int,
        proposals: Proposals,
        T_world_sensor: Float64,
        rows: Int,
    ) -> None:
        """Write the columns of all tracks, but the yaw of the objects in view, whose rows (R,) are given."""
        columns = {name: getattr(motion, name) for name in _OF_THE_TRACKER}
        columns["velocity_covariance"] = motion.velocity_covariance.reshape(-1, 4)
        ground_z_m = proposals.ground_z_m
        forward_x, forward_y = forward_of(T_world_sensor)
        self._library.modt_object_boxes(
            _COLUMNS.of(own, **columns, object_class=object_class, m=len(own)),
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


_OF_THE_TRACKER = "box", "x", "velocity", "moved_m", "proposal", "motion"


def whole_boxes_of(kernels: GeometryKernels, tuning: ObjectBoxTuning = ObjectBoxTuning()) -> WholeBoxes:
    """The estimator: native if the kernels have a library, else in NumPy."""
    return WholeBoxes(kernels, tuning) if kernels.library is None else NativeWholeBoxes(kernels.library, tuning)
