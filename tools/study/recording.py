"""A drive segmented, followed by its truth and classified once, and played back for whatever comes after that.

So that only key views and fusion act, the tracker is an ideal one: a proposal goes to the true object that holds most
of its points; of several, the one with the most points. What belongs to no object, and what broke off one, is
followed by our own tracker; and so is everything where that is asked for.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from modt.classification.prior import Prior, object_probability_reaches
from modt.config import ProfileConfig
from modt.geometry import transform_boxes
from modt.pipeline import Classifier
from modt.segmentation.segmenter import Segmenter
from modt.tracking.states import ACCURATE
from modt.tracking.tracker import Tracker
from modt.types import NONE, Bool, Float32, Float64, Frame, Int, Proposals, Tracks
from tools.train.build_crops import label
from tools.train.labelled_scans import Scan


@dataclass(frozen=True, slots=True)
class Moment:
    """What is known of one frame.

    Attributes:
        proposals: its segments.
        box: (P, 7) their boxes in the world.
        track: (P,) row of the track of each.
        prior: (P, 4) what is thought of each by its box.
        likelihood: (P, 4) what the network says of each.
        kind: (P,) true class.
        judged: (P,) clearly one object, or clearly none; of our own tracker pieces and mergers too, as background.
    """

    proposals: Proposals
    box: Float64
    track: Int
    prior: Float64
    likelihood: Float64
    kind: Int
    judged: Bool


@dataclass(frozen=True, slots=True)
class Recording:
    """A drive.

    Attributes:
        name: of it.
        moments: frame by frame.
        n_tracks: how many tracks they show.
        pool_weight: of the box in what the network said.
    """

    name: str
    moments: tuple[Moment, ...]
    n_tracks: int
    pool_weight: float = 0.0

    @property
    def n_proposals(self) -> int:
        """Calls of tracking by detection, which classifies whatever it sees."""
        return sum(len(moment.proposals) for moment in self.moments)

    def judged_from(self, points: int) -> Recording:
        """The same drive, of which only proposals of so many points are judged."""
        large = (replace(m, judged=m.judged & (m.proposals.count >= points)) for m in self.moments)
        return replace(self, moments=tuple(large))


def record(
    name: str,
    drive: Iterable[tuple[Frame, Scan]],
    config: ProfileConfig,
    network: Classifier,
    prior: Prior,
    *,
    ideal: bool = True,
) -> Recording:
    """Everything before fusion, once.

    Args:
        name: of the drive.
        drive: frames, and their labels with the objects' numbers.
        config: of segmentation and of our own tracker.
        network: that says what each proposal is.
        prior: that says what it may be by its box.
        ideal: objects are followed by the ideal tracker.
    """
    tracker = Tracker(config.tracking, ACCURATE)
    rows: dict[tuple[str, int], int] = {}
    moments = []
    for frame, scan in drive:
        proposals = Segmenter(config.segmentation, config.sensor, scan.fov).segment(frame.points)
        own, proposals = tracker.follow(frame, proposals), tracker.proposals
        ids = own.id[own.row_of_proposal(len(proposals))]
        keys = [
            ("body", body) if ideal and body != NONE else ("track", i)
            for i, body in zip(ids.tolist(), owners(scan, proposals).tolist(), strict=True)
        ]
        labels = label(scan, proposals)
        moments.append(
            Moment(
                proposals=proposals,
                box=transform_boxes(tracker.T_world_sensor, proposals.box),
                track=np.array([rows.setdefault(key, len(rows)) for key in keys], np.int64),
                prior=prior.probability(proposals),
                likelihood=network.classify(frame.points, proposals, np.arange(len(proposals))),
                kind=labels.kind,
                judged=~labels.unknown & ~(labels.partial & ideal),
            )
        )
    return Recording(name, tuple(moments), len(rows), prior.pool_weight)


def owners(scan: Scan, proposals: Proposals) -> Int:
    """(P,) number of the object that each proposal shows most of, NONE where it is of none or a lesser piece."""
    of = proposals.label(len(scan.points))
    owner = np.full(len(proposals), NONE, np.int64)
    for members, number in zip(scan.objects, scan.numbers, strict=True):
        own = of[members]
        shared = np.bincount(own[own != NONE], minlength=len(proposals))
        pieces = np.flatnonzero(shared > 0.5 * proposals.count)
        if len(pieces):
            owner[pieces[shared[pieces].argmax()]] = number
    return owner


class Player:
    """Segmenter, tracker, classifier and prior of a pipeline, from a recording, frame by frame.

    The table has a row for every track of the drive, before its birth and after its end as well.

    Args:
        recording: what to play.
        ask_from: frames with a proposal before a track asks for a class.
    """

    state_names = ("followed",)

    def __init__(self, recording: Recording, ask_from: int) -> None:
        self._moments = iter(recording.moments)
        self._ask_from = ask_from
        self.pool_weight = recording.pool_weight
        self._tracks = Tracks.blank(recording.n_tracks)
        self._tracks.id[:] = np.arange(recording.n_tracks)

    @property
    def proposals(self) -> Proposals:
        """Those of the moment."""
        return self._moment.proposals

    def segment(self, points: Float32) -> Proposals:
        """The next frame's proposals."""
        self._moment = next(self._moments)
        return self._moment.proposals

    def follow(self, frame: Frame, proposals: Proposals) -> Tracks:
        """Each to its track."""
        t, rows = self._tracks, self._moment.track
        t.proposal[:] = NONE
        t.proposal[rows] = np.arange(len(rows))
        t.box[rows], t.points[rows] = self._moment.box, proposals.count
        t.hits[rows] += 1
        t.age += t.hits > 0
        t.missed = np.where(t.proposal == NONE, t.missed + 1, 0)
        return t

    def asking(self) -> Bool:
        """(M,) tracks seen often enough, whose class is not settled."""
        t = self._tracks
        asks: Bool = (t.proposal != NONE) & ~t.final & (t.hits >= self._ask_from)
        return asks

    def settle(self, rows: Int, certain: Bool) -> None:
        """Nothing: what is settled stands in the table already."""

    def classify(self, points: Float32, proposals: Proposals, which: Int) -> Float64:
        """(R, 4) what the network said when the drive was recorded."""
        return self._moment.likelihood[which]

    def probability(self, proposals: Proposals) -> Float64:
        """(P, 4) what was thought of them then."""
        return self._moment.prior

    def may_be_object(self, probability: Float64, threshold: float) -> Bool:
        """(M,) which may be objects by what was thought of them."""
        return object_probability_reaches(probability, threshold)

    def facts(self) -> dict[str, str]:
        """No model runs."""
        return {}
