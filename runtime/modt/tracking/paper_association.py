"""The paper's association."""

from __future__ import annotations

import numpy as np

from modt.config import PaperAssociationConfig
from modt.geometry.overlap import iou_3d
from modt.observations import Observations
from modt.tracking.assignment import assign
from modt.tracking.association import Matches
from modt.tracking.track_table import TrackTable
from modt.types import Float64, Int

_NO_PARTNER = 1e6
"""Cost of leaving a row without a partner: the paper gates before the assignment only."""


class PaperAssociation:
    """The paper's cost (section III-B), gated by T_DA; the position of a proposal is its centroid.

    The paper writes the cost as alpha (1 - I) - beta N - gamma S with N and S *differences* of point number and
    size: taken literally, a worse match would cost less. Both are read as penalties here. I is the intersection
    over union of the boxes' volumes, S the sum of the differences of length, width and height [m].
    """

    def __init__(self, config: PaperAssociationConfig) -> None:
        self.config = config

    def match(self, tracks: TrackTable, observations: Observations) -> Matches:
        """Pairs whose cost is at most T_DA."""
        rows, columns = self._near(tracks, observations)
        cost = self.cost(tracks, observations, rows, columns)
        low = cost <= self.config.t_da
        rows, columns, cost = rows[low], columns[low], cost[low]
        keep = assign(rows, columns, cost, _NO_PARTNER)
        covariance = np.square(self.config.position_sigma_m) * np.eye(2)[None].repeat(len(keep), axis=0)
        rows, columns = rows[keep], columns[keep]
        return Matches(rows, columns, observations.centroid[columns], covariance, np.zeros((len(keep), 4)))

    def cost(self, tracks: TrackTable, observations: Observations, rows: Int, columns: Int) -> Float64:
        """(K,) cost of the pairs."""
        a, b = tracks.box[rows].copy(), observations.box[columns]
        a[:, :2] += tracks.x[rows, :2] - tracks.anchor[rows]  # the last box, carried along the prediction
        points = np.abs(tracks.points[rows] - observations.count[columns])
        size = np.abs(a[:, 3:6] - b[:, 3:6]).sum(axis=1)
        penalty: Float64 = (
            self.config.alpha * (1 - iou_3d(a, b)) + self.config.beta * points + self.config.gamma * size
        )
        return penalty

    def initial_position(self, observations: Observations) -> Float64:
        """Mean of the points."""
        return observations.centroid

    def _near(self, tracks: TrackTable, observations: Observations) -> tuple[Int, Int]:
        """Pairs whose boxes could touch: without overlap no pair can pass, unless alpha is below T_DA."""
        centre = tracks.box[:, :2] + tracks.x[:, :2] - tracks.anchor
        offset = centre[:, None] - observations.box[None, :, :2]
        if self.config.alpha <= self.config.t_da:
            near = np.ones(offset.shape[:2], np.bool_)
        else:
            reach = np.hypot(tracks.box[:, 3], tracks.box[:, 4])[:, None]
            reach = (reach + np.hypot(observations.box[:, 3], observations.box[:, 4])) / 2
            near = (offset**2).sum(axis=2) < reach**2
        rows, columns = np.nonzero(near)
        return rows, columns
