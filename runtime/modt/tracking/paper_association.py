"""The paper's association."""

from __future__ import annotations

import numpy as np

from modt.config import PaperAssociationConfig
from modt.geometry.boxes import iou_3d
from modt.observations import Observations
from modt.tracking.association import Matches, assign
from modt.tracking.track_table import TrackTable
from modt.types import Bool, Float64, Int

_NO_PARTNER = 1e6
"""Cost of leaving a row without a partner."""


class GateBefore:
    """A pair above T_DA does not compete with others."""

    def __init__(self, t_da: float) -> None:
        self._t_da = t_da

    def assign(self, rows: Int, columns: Int, cost: Float64) -> Int:
        """Indices of the pairs (K,) that are kept."""
        low = (cost <= self._t_da).nonzero()[0]
        return low[assign(rows[low], columns[low], cost[low], _NO_PARTNER)]


class GateAfter(GateBefore):
    """All pairs compete; of those assigned, the ones above T_DA are rejected (section III-B)."""

    def assign(self, rows: Int, columns: Int, cost: Float64) -> Int:
        """Indices of the pairs (K,) that are kept."""
        kept = assign(rows, columns, cost, _NO_PARTNER)
        return kept[cost[kept] <= self._t_da]


GATES = {"before": GateBefore, "after": GateAfter}
SIGNS = {"added": 1.0, "subtracted": -1.0}


class PaperAssociation:
    """The paper's cost (section III-B), gated by T_DA; the position of a proposal is its centroid.

    The paper writes the cost as alpha (1 - I) - beta N - gamma S with N and S *differences* of point number and
    size: taken literally, a worse match would cost less. Both are read as penalties here, unless `differences` are
    to be subtracted. I is the intersection over union of the boxes' volumes, S the sum of the differences of length,
    width and height [m].
    """

    def __init__(self, config: PaperAssociationConfig) -> None:
        self.config = config
        self._gate, self._sign = GATES[config.gate](config.t_da), SIGNS[config.differences]

    def match(self, tracks: TrackTable, observations: Observations) -> Matches:
        """Pairs whose cost is at most T_DA."""
        rows, columns = np.indices((len(tracks), len(observations))).reshape(2, -1)
        keep = self._gate.assign(rows, columns, self.cost(tracks, observations, rows, columns))
        covariance = np.square(self.config.position_sigma_m) * np.eye(2)[None].repeat(len(keep), axis=0)
        rows, columns = rows[keep], columns[keep]
        return Matches(rows, columns, observations.centroid[columns], covariance, np.zeros((len(keep), 4)))

    def cost(self, tracks: TrackTable, observations: Observations, rows: Int, columns: Int) -> Float64:
        """(K,) cost of the pairs."""
        a, b = tracks.box.copy(), observations.box
        a[:, :2] += tracks.x[:, :2] - tracks.anchor  # the last box, carried along the prediction
        points = np.abs(tracks.points[rows] - observations.count[columns])
        length, width, height = (np.abs(a[:, k][rows] - b[:, k][columns]) for k in (3, 4, 5))
        size = length + width + height
        apart = np.ones(len(rows))
        near = _may_touch(a, b, rows, columns).nonzero()[0]
        apart[near] -= iou_3d(a[rows[near]], b[columns[near]])
        differences = self.config.beta * points + self.config.gamma * size
        cost: Float64 = self.config.alpha * apart + self._sign * differences
        return cost

    def initial_position(self, observations: Observations) -> Float64:
        """Mean of the points."""
        return observations.centroid


def _may_touch(a: Float64, b: Float64, rows: Int, columns: Int) -> Bool:
    """(K,) whether the circles around the pairs of boxes a (M, 7) and b (P, 7) overlap."""
    reach = np.hypot(a[:, 3], a[:, 4])[rows] + np.hypot(b[:, 3], b[:, 4])[columns]
    x, y = (a[:, k][rows] - b[:, k][columns] for k in (0, 1))
    touch: Bool = np.hypot(x, y) < reach / 2
    return touch
