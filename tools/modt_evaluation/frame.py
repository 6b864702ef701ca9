"""Results and truth of one frame, side by side for the judgement."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from modt.classes import N_CLASSES
from modt.geometry import FieldOfView, inverse, se3, transform_boxes
from modt.types import NONE, Float32, Float64, FrameResult, Int, Self
from modt_evaluation.truth import FrameTruth


@dataclass(frozen=True)
class JudgedFrame:
    """Results and truth of a frame of N points and M visible tracks."""

    index: int
    points: Float32  # (N, 4) sensor frame
    proposal: Int  # (N,) of each point, NONE where it belongs to none
    n_proposals: int
    classified: int  # proposals classified in the frame
    track: Int  # (M,) identities
    of_track: Int  # (M,) proposals
    reported: Int  # (M,) classes
    posterior: Float64  # (M, 4)
    truth: FrameTruth
    fov: FieldOfView = field(default_factory=FieldOfView)
    box: Float64 | None = None  # (M, 7) whole boxes, sensor frame
    velocity: Float64 | None = None  # (M, 2) [m/s, world]
    T_world_sensor: Float64 = field(default_factory=lambda: np.eye(4))
    stamp_s: float = 0.0

    @classmethod
    def of_result(cls, result: FrameResult, truth: FrameTruth, fov: FieldOfView | None = None) -> Self:
        """Frame judged by a result of the pipeline in memory; the truth is that of the sensor frame."""
        R = result.frame.R_level_sensor
        if R is not None:
            truth = replace(truth, T_box_sensor=truth.T_box_sensor @ inverse(se3(R, np.zeros(3))))
        tracks = result.tracks
        seen = np.flatnonzero(tracks.proposal != NONE)
        return cls(
            index=result.frame.index,
            points=result.frame.points,
            proposal=result.proposals.label(len(result.frame.points)),
            n_proposals=len(result.proposals),
            classified=len(result.classified),
            track=tracks.id[seen],
            of_track=tracks.proposal[seen],
            reported=tracks.object_class[seen],
            posterior=tracks.posterior[seen],
            truth=truth,
            fov=FieldOfView() if fov is None else fov,
            box=transform_boxes(inverse(result.T_world_sensor), tracks.whole_box[seen]),
            velocity=tracks.velocity[seen],
            T_world_sensor=result.T_world_sensor,
            stamp_s=result.frame.stamp_s,
        )

    @classmethod
    def without_tracks(cls, index: int, points: Float32, proposal: Int, n_proposals: int, truth: FrameTruth) -> Self:
        """A frame in which nothing is tracked."""
        none = np.zeros(0, np.int64)
        return cls(index, points, proposal, n_proposals, 0, none, none, none, np.zeros((0, N_CLASSES)), truth)
