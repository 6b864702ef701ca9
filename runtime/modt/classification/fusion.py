"""Which views are classified, and what is made of them (section V-C): three objects, each a `pipeline.Fusion`.

`asks` says which of the tracks that want a class show a view worth classifying, `fuse` takes what the network said
and tells which tracks are now certain. Both work on the table of tracks in place.
"""

from __future__ import annotations

import numpy as np

from modt.classification.posterior import FLOOR, expect, normal, sane
from modt.classification.prior import Frequency, Prior, shares
from modt.config import FusionConfig
from modt.geometry import wrap
from modt.types import NONE, Bool, Float64, Int, Proposals, Tracks

CHANCE = 5
"""Points that come and go by chance: so many more are no closer look."""


class EveryFrame:
    """Tracking by detection: whatever is seen is classified, and this frame's word is the class (Fig. 2a)."""

    def asks(self, tracks: Tracks, proposals: Proposals, asking: Bool) -> Bool:
        """Every track with a proposal."""
        seen: Bool = tracks.proposal != NONE
        return seen

    def fuse(self, tracks: Tracks, proposals: Proposals, rows: Int, likelihood: Float64) -> Bool:
        """Takes this view for all there is."""
        tracks.posterior[rows] = sane(likelihood)
        tracks.views[rows] = 1
        _remember(tracks, proposals, rows)
        return np.ones(len(rows), np.bool_)


class FirstView:
    """Efficient: the first classification is final (Table I), so it waits for a box that may well be an object's.

    And for what was seen before: first views are often far and partial (Fig. 11), and what flickers has no second.

    Args:
        config: from when on it may, and what a box has to say.
        prior: what is thought of a proposal unseen; by default as common as the classes are.
    """

    def __init__(self, config: FusionConfig, prior: Prior | None = None) -> None:
        self.config = config
        self.prior = prior or Frequency(config.prior)

    def asks(self, tracks: Tracks, proposals: Proposals, asking: Bool) -> Bool:
        """The tracks that have no class."""
        expect(tracks, proposals, self.prior, self.config.box_weight, self.config.slip)
        asks: Bool = asking & ~tracks.final & (tracks.proposal != NONE) & (tracks.hits >= self.config.once_from)
        return asks & self.prior.likely(tracks.prior, self.config.likely_once)

    def fuse(self, tracks: Tracks, proposals: Proposals, rows: Int, likelihood: Float64) -> Bool:
        """Settles the class."""
        tracks.posterior[rows] = sane(likelihood)
        tracks.views[rows] = 1
        _remember(tracks, proposals, rows)
        return np.ones(len(rows), np.bool_)


class KeyViews:
    """Accurate: the views that are independent of the last one are multiplied (Equations 4 to 6, Table II).

    A view counts as independent by its number of points, by the direction and the distance from which it is taken or
    by its extent. A new track is classified at first sight; what that says settles its class if it is distinct, and
    is else forgotten at the starting frame, since far and partial first views mislead (Fig. 11).

    The network's word is a posterior under the frequency of the classes among proposals and, by its share, under
    what the box says; Equation 6 multiplies likelihoods, so each further view is divided by these, lest they be
    counted once a view. Views of one object are never wholly independent: a further one may be given less than its
    full weight. And a class that was settled from afar is looked at again when the object shows clearly more points,
    and what was known counts only by its share of these; so is what took its class over from its place. What by its
    box is no object is neither classified nor looked at again.

    Args:
        config: thresholds of independence and certainty.
        prior: what is thought of a proposal unseen; by default as common as the classes are.
    """

    def __init__(self, config: FusionConfig, prior: Prior | None = None) -> None:
        self.config = config
        self.prior = prior or Frequency(config.prior)
        self._alpha = np.array([config.background_alpha, *config.alpha])
        share = np.maximum(shares(config.prior), FLOOR)
        self._log_prior = np.log(share / share.sum())

    def asks(self, tracks: Tracks, proposals: Proposals, asking: Bool) -> Bool:
        """Those asking that were never classified or show an independent view, and the settled that came close."""
        expect(tracks, proposals, self.prior, self.config.box_weight, self.config.slip)
        seen = tracks.proposal != NONE
        asks: Bool = (asking | tracks.viewed) & ~tracks.final & seen
        rows = np.flatnonzero(asks)
        started = tracks.age[rows] >= self.config.start_frame
        fresh = (tracks.views[rows] == 0) | self.independent(tracks, proposals, rows)
        first = ~tracks.viewed[rows]
        asks[rows] = np.where(first, self.prior.likely(tracks.prior[rows], self.config.likely), started & fresh)
        return asks | self._reopened(tracks, proposals, np.flatnonzero(seen & tracks.final))

    def _reopened(self, tracks: Tracks, proposals: Proposals, rows: Int) -> Bool:
        """(M,) which of these rows, settled as they are, show so much more that they are worth another look."""
        again = np.zeros(len(tracks), np.bool_)
        if self.config.reopen_ratio is not None:
            many = self.config.reopen_ratio * tracks.key_points[rows] + CHANCE
            again[rows] = proposals.count[tracks.proposal[rows]] > many
            again &= tracks.key_points < self.config.reopen_points
            again &= self.prior.likely(tracks.prior, self.config.likely_again)
        return again

    def independent(self, tracks: Tracks, proposals: Proposals, rows: Int) -> Bool:
        """(R,) whether the view of each track differs enough from its last key observation (Equation 4)."""
        limit, own = self.config, tracks.proposal[rows]
        box = proposals.box[own]
        likely = np.argmax(tracks.posterior[rows], axis=1)
        bearing, distance = _view(tracks, proposals, rows)
        change = _relative(proposals.count[own], tracks.key_points[rows])
        nearer = _relative(distance, tracks.key_range[rows])
        grown = _relative(box[:, 3:6], tracks.key_extent[rows]).max(axis=1, initial=0.0)
        turned = np.abs(wrap(bearing - tracks.key_bearing[rows]))
        independent: Bool = (
            (change > self._alpha[likely])
            | (turned > np.deg2rad(limit.bearing_deg))
            | (nearer > limit.range_ratio)
            | (grown > limit.extent_ratio)
        )
        return independent

    def fuse(self, tracks: Tracks, proposals: Proposals, rows: Int, likelihood: Float64) -> Bool:
        """Multiplies the view into the posterior, in logarithms (Equation 6), and fixes what is certain."""
        view, before = np.log(sane(likelihood)), self._unseen(tracks.prior[rows])
        evidence = self.config.view_weight * (view - before)
        fused = (tracks.views[rows] > 0)[:, None]
        past = np.log(sane(tracks.key_posterior[rows])) - self._unseen(tracks.key_prior[rows])
        share = tracks.key_points[rows] / np.maximum(proposals.count[tracks.proposal[rows]], 1)
        past *= np.where(tracks.final[rows], np.minimum(share, 1.0), 1.0)[:, None]
        posterior = normal(np.where(fused, before + past + evidence, view))
        certain = self._certain(posterior)
        tracks.posterior[rows] = posterior
        tracks.views[rows] += certain | (tracks.age[rows] >= self.config.start_frame)
        _remember(tracks, proposals, rows)
        return certain

    def _unseen(self, boxes: Float64) -> Float64:
        """(R, 4) logarithm of what a view's word holds without the view, given (R, 4) what the boxes say."""
        share = self.prior.share
        unseen: Float64 = (1.0 - share) * self._log_prior + share * np.log(np.maximum(boxes, FLOOR))
        return unseen

    def _certain(self, posterior: Float64) -> Bool:
        """(R,) whether an object's posterior, or the evidence for background, reaches its threshold.

        Most proposals are background before anyone looks, so its posterior is high for nothing. What counts for it is
        what it would be if all classes were equally common.
        """
        objects: Bool = posterior[:, 1:].max(axis=1, initial=0.0) >= self.config.threshold
        evidence = normal(np.log(posterior) - self._log_prior)[:, 0]
        return objects | (evidence >= self.config.background_threshold)


def _relative(now: Float64 | Int, before: Float64 | Int) -> Float64:
    change: Float64 = np.abs(now - before) / np.maximum(before, 1e-3)
    return change


def _view(tracks: Tracks, proposals: Proposals, rows: Int) -> tuple[Float64, Float64]:
    """(R,) direction of the line of sight in the world [rad], and distance [m].

    The tracks hold their proposals' boxes in the world frame, so the two yaws of a box differ by the sensor's own.
    """
    box = proposals.box[tracks.proposal[rows]]
    sensor_yaw = wrap(tracks.box[rows, 6] - box[:, 6])
    return wrap(np.arctan2(box[:, 1], box[:, 0]) + sensor_yaw), np.hypot(box[:, 0], box[:, 1])


def _remember(tracks: Tracks, proposals: Proposals, rows: Int) -> None:
    own = tracks.proposal[rows]
    tracks.key_prior[rows], tracks.key_posterior[rows] = tracks.prior[rows], tracks.posterior[rows]
    tracks.key_bearing[rows], tracks.key_range[rows] = _view(tracks, proposals, rows)
    tracks.key_points[rows] = proposals.count[own]
    tracks.key_extent[rows] = proposals.box[own, 3:6]
