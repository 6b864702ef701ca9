"""The stages before tracking, played back: what they made of a drive is the same in every replay."""

from __future__ import annotations

import numpy as np

from modt.classification.pointnet import PointNet
from modt.config import ProfileConfig
from modt.profile import dump
from modt.types import NONE, Bool, Float32, Float64, Int, Proposals
from modt_desk.experiments.segmented import SegmentedDrive, SegmentedFrame
from modt_desk.experiments.store import Store, key_of


def likelihoods(drive: SegmentedDrive, network: PointNet, config: ProfileConfig, store: Store) -> list[Float64]:
    """(P, 4) of the network, by frame, for every proposal of the segmentation; from the store where it was before."""
    described = dump(config)
    key = key_of("likelihoods", drive.key, network.facts(), described["classification"], described["sensor"])

    def made(known: SegmentedFrame) -> Float64:
        return network.classify(known.frame.points, known.proposals, np.arange(len(known.proposals)))

    arrays = store.made(key, lambda: {str(k): made(known) for k, known in enumerate(drive.frames)})
    return [arrays[str(k)] for k in range(len(drive.frames))]


class PlayedBack:
    """Segmenter and classifier of a pipeline; the network sees only what the tracker has regrouped.

    Args:
        drive: that is segmented.
        known: likelihoods of its proposals, by frame.
        network: for others.
        range_m: range of interest: what is farther is not there.
    """

    def __init__(
        self, drive: SegmentedDrive, known: list[Float64], network: PointNet, range_m: float = np.inf
    ) -> None:
        self._frames = zip(drive.frames, known, strict=True)
        self._network, self._range_m = network, range_m

    def facts(self) -> dict[str, str]:
        """Of the network."""
        return self._network.facts()

    def segment(self, points: Float32) -> Proposals:
        """Those of the next frame."""
        frame, self._known = next(self._frames)
        self._own = frame.proposals
        self._row = {first: row for row, first in enumerate(self._own.members[self._own.offsets[:-1]].tolist())}
        return self._own.take(np.flatnonzero(within(self._own, self._range_m)))

    def classify(self, points: Float32, proposals: Proposals, which: Int) -> Float64:
        """(R, 4) likelihoods of the proposals given by index."""
        rows = np.array([self._row_of(proposals, k) for k in which.tolist()], np.int64)
        found: Float64 = self._known[rows]
        new = np.flatnonzero(rows == NONE)
        if len(new):
            found[new] = self._network.classify(points, proposals, which[new])
        return found

    def _row_of(self, proposals: Proposals, k: int) -> int:
        """The proposal of the segmentation that has the same points and box, NONE where there is none."""
        own, members = self._own, proposals.members[proposals.offsets[k] : proposals.offsets[k + 1]]
        row = self._row.get(int(members[0]), NONE)
        of_row = own.members[own.offsets[row] : own.offsets[row + 1]]
        same = np.array_equal(members, of_row) and np.array_equal(proposals.box[k], own.box[row])
        return row if same else NONE


def within(proposals: Proposals, range_m: float) -> Bool:
    """(P,) proposals within a range."""
    near: Bool = np.hypot(proposals.centroid[:, 0], proposals.centroid[:, 1]) <= range_m
    return near
