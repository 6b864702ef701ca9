"""The paper's association."""

from __future__ import annotations

import numpy as np

from modt.geometry.kernels import assign
from modt.observations import Observations
from modt.tracking.association import Matches
from modt.tracking.track_table import TrackTable
from modt.tracking.tuning import PaperAssociationTuning
from modt.types import Float64, Int

_NO_PARTNER = 1e6
"""Cost of leaving a row without a partner."""
_TINY = 1e-9


class PaperAssociation:
    """The paper's cost (section III-B), rejected above T_DA; the position of a proposal is its centroid.

    The paper writes alpha (1 - I) - beta N - gamma S with N and S *differences* of point number and size, by which a
    worse match would cost less. It is read with likenesses in their place, which a good match is rewarded for:

    - I: intersection over union, seen from above, of the upright boxes around the oriented ones, with sides along
      the axes of the world and the centroids as their centres. That of the track is its last one, at the position
      that the filter predicts.
    - N: the lesser number of points over the greater.
    - S: the same of length, width and height, added up.

    T_DA = 0.95 then asks for an overlap of 0.37 of proposals that are alike, of 0.52 of others. All pairs compete in
    the assignment; those of a higher cost are rejected afterwards.

    Args:
        tuning: weights and threshold of the paper, and the deviation of a centroid.
    """

    def __init__(self, tuning: PaperAssociationTuning = PaperAssociationTuning()) -> None:
        self._tuning = tuning

    def match(self, tracks: TrackTable, observations: Observations) -> Matches:
        """Pairs of least cost in all, without those above T_DA."""
        rows, columns = np.indices((len(tracks), len(observations))).reshape(2, -1)
        cost = self.cost(tracks, observations, rows, columns)
        kept = assign(rows, columns, cost, _NO_PARTNER)
        kept = kept[cost[kept] <= self._tuning.max_cost]
        columns = columns[kept]
        covariance = np.square(self._tuning.position_sigma_m) * np.eye(2)[None].repeat(len(kept), axis=0)
        return Matches(rows[kept], columns, observations.centroid[columns], covariance, np.zeros((len(kept), 4)))

    def cost(self, tracks: TrackTable, observations: Observations, rows: Int, columns: Int) -> Float64:
        """(K,) cost of the pairs."""
        track_box = tracks.box[rows]
        box = observations.box[columns]
        overlap = _overlap(
            tracks.x[rows, :2], _sides_along_axes(track_box), observations.centroid[columns], _sides_along_axes(box)
        )
        points = _likeness(tracks.points[rows], observations.count[columns])
        size = _likeness(track_box[:, 3:6], box[:, 3:6]).sum(axis=1)
        tuning = self._tuning
        cost: Float64 = tuning.alpha * (1 - overlap) - tuning.beta * points - tuning.gamma * size
        return cost

    def initial_position(self, observations: Observations) -> Float64:
        """Mean of the points."""
        return observations.centroid


def _likeness(a: Float64 | Int, b: Float64 | Int) -> Float64:
    """The lesser over the greater, number by number."""
    likeness: Float64 = np.minimum(a, b) / np.maximum(np.maximum(a, b), _TINY)
    return likeness


def _sides_along_axes(boxes: Float64) -> Float64:
    """(n, 2) extent along x and y of boxes (n, 7) seen from above."""
    c = np.abs(np.cos(boxes[:, 6]))
    s = np.abs(np.sin(boxes[:, 6]))
    length = boxes[:, 3]
    width = boxes[:, 4]
    return np.stack([length * c + width * s, length * s + width * c], axis=1)


def _overlap(centre_a: Float64, sides_a: Float64, centre_b: Float64, sides_b: Float64) -> Float64:
    """(n,) intersection over union of rectangles along the axes, by centres and sides (n, 2)."""
    low = np.maximum(centre_a - sides_a / 2, centre_b - sides_b / 2)
    high = np.minimum(centre_a + sides_a / 2, centre_b + sides_b / 2)
    shared = np.maximum(high - low, 0.0).prod(axis=1)
    union = sides_a.prod(axis=1) + sides_b.prod(axis=1) - shared
    overlap: Float64 = shared / np.maximum(union, _TINY)
    return overlap
