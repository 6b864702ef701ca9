"""Result of a frame."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from modt.types.arrays import Float64, Int
from modt.types.frame import Frame
from modt.types.proposals import LEFT_OUT, OBSTACLES, PointKind, Proposals
from modt.types.tracks import Tracks
from modt.types.trust import TRUSTED, Trust


@dataclass(frozen=True)
class FrameResult:
    """Result of a frame."""

    frame: Frame  # the frame, turned level. All results in the sensor frame, and the pose, refer to the level frame.
    T_world_sensor: Float64  # (4, 4) pose of the sensor at the stamp, as the odometry placed it
    proposals: Proposals
    tracks: Tracks  # a snapshot of those alive after the frame, read-only
    state_names: tuple[str, ...]  # name of each value of tracks.state
    n_deferred: int  # tracks whose request for a class waits for the next frame's budget
    classified: Int = field(default_factory=lambda: np.zeros(0, np.int64))  # identities of the tracks
    run_id: str = ""  # 16 hexadecimal digits of a service, whose frames and tracks count from 0; "" of a replay
    trust: Trust = TRUSTED

    @property
    def labels(self) -> Int:
        """(N,) identity of the track that each point of the frame belongs to, else its PointKind, which is negative.

        Raises:
            ValueError: the proposals come from a record, which does not hold the kinds of the points.
        """
        kind = self.proposals.kind
        if kind is None:
            raise ValueError("the proposals do not tell the kinds of the points")
        labels = kind.astype(np.int64)
        row_of_proposal = self.tracks.row_of_proposal(len(self.proposals))
        labels[self.proposals.members] = self.tracks.id[row_of_proposal].repeat(self.proposals.count)
        if self.proposals.feet is not None:
            foot, beside = self.proposals.feet
            labels[foot] = labels[beside]
        return labels

    def obstacles(self) -> Int:
        """(K,) rows of the points that stand above the ground and below the ceiling, whatever they belong to."""
        labels = self.labels
        return np.flatnonzero((labels >= 0) | np.isin(labels, OBSTACLES))

    def left_out(self) -> dict[PointKind, int]:
        """Number of points of each kind in LEFT_OUT."""
        kind = self.proposals.kind
        if kind is None:
            return dict.fromkeys(LEFT_OUT, 0)
        # Seven comparisons of bytes take a third of the time of `bincount`, which widens them; so would a PointKind.
        return {each: int(np.count_nonzero(kind == each.value)) for each in LEFT_OUT}
