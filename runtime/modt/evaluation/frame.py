"""What was found in a frame beside what is true of it: all that is judged."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Self

import numpy as np

from modt.evaluation.truth import FrameTruth
from modt.geometry import FieldOfView
from modt.types import NONE, Float32, Float64, FrameResult, Int


@dataclass(frozen=True, slots=True)
class JudgedFrame:
    """What was found in a frame, and what is true of it.

    Attributes:
        index: number of the frame.
        points: (N, 4) sensor frame.
        proposal: (N,) proposal of each point, NONE where it belongs to none.
        n_proposals: in the frame.
        classified: proposals classified in it.
        track: (M,) identity of each track that is seen.
        of_track: (M,) its proposal.
        said: (M,) its class.
        posterior: (M, 4) its posterior.
        truth: labels of the frame.
        fov: the part of space that was looked at.
    """

    index: int
    points: Float32
    proposal: Int
    n_proposals: int
    classified: int
    track: Int
    of_track: Int
    said: Int
    posterior: Float64
    truth: FrameTruth
    fov: FieldOfView = field(default_factory=FieldOfView)

    @classmethod
    def of_result(cls, result: FrameResult, truth: FrameTruth, fov: FieldOfView | None = None) -> Self:
        """A result of the pipeline that is still in memory."""
        tracks, proposals = result.tracks, result.proposals
        seen = np.flatnonzero(tracks.proposal != NONE)
        return cls(
            index=result.frame.index,
            points=result.frame.points,
            proposal=proposals.label(len(result.frame.points)),
            n_proposals=len(proposals),
            classified=result.n_classified,
            track=tracks.id[seen],
            of_track=tracks.proposal[seen],
            said=tracks.object_class[seen],
            posterior=tracks.posterior[seen],
            truth=truth,
            fov=FieldOfView() if fov is None else fov,
        )
