"""Recordings of drives up to the classifier, with true tracks, and their playback in a pipeline.

The tracker of a recording is an ideal one, so that only key views and fusion differ between replays: a proposal
belongs to the true object that holds most of its points; of several, the one with the most points. Proposals of no
object, and further fragments of one, are tracked by modt's own tracker; without `ideal` all proposals are.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from modt.classes import N_CLASSES
from modt.classification.prior import Prior, object_probability_reaches
from modt.config import ProfileConfig
from modt.geometry import transform_boxes
from modt.observations import Located, StaticTracks, observe
from modt.odometry.odometry import Odometry
from modt.pipeline import Classifier
from modt.placement import Placement
from modt.segmentation.segmenter import Segmenter
from modt.tracking.states import ACCURATE
from modt.tracking.tracker import Tracker
from modt.types import NONE, Bool, Float32, Float64, Frame, Int, Proposals, TrackedFrame, Tracks
from tools.train.build_crops import label
from tools.train.labelled_scans import Scan


@dataclass(frozen=True, slots=True)
class RecordedFrame:
    """One frame of a recording.

    Attributes:
        proposals: its segments.
        box: (P, 7) their boxes in the world.
        track: (P,) row of the track of each.
        prior: (P, 4) class probabilities from the box.
        likelihood: (P, 4) class probabilities from the network.
        kind: (P,) true class.
        scored: (P,) clearly one object, or clearly none; without the ideal tracker fragments and merged objects too,
            as background.
    """

    proposals: Proposals
    box: Float64
    track: Int
    prior: Float64
    likelihood: Float64
    kind: Int
    scored: Bool


@dataclass(frozen=True, slots=True)
class Recording:
    """A drive.

    Attributes:
        name: of the drive.
        frames: in order.
        n_tracks: number of tracks.
        pool_weight: weight of the box in the likelihood.
    """

    name: str
    frames: tuple[RecordedFrame, ...]
    n_tracks: int
    pool_weight: float = 0.0

    @property
    def n_proposals(self) -> int:
        """Classifier calls of tracking by detection, which classifies every proposal."""
        return sum(len(recorded.proposals) for recorded in self.frames)

    def scored_from(self, points: int) -> Recording:
        """The recording with only proposals of at least `points` points scored."""
        large = (replace(r, scored=r.scored & (r.proposals.count >= points)) for r in self.frames)
        return replace(self, frames=tuple(large))


def record(
    name: str,
    drive: Iterable[tuple[Frame, Scan]],
    config: ProfileConfig,
    network: Classifier,
    prior: Prior,
    *,
    ideal: bool = True,
) -> Recording:
    """Run segmentation, tracking and classification of all proposals on a drive.

    Args:
        name: of the drive.
        drive: frames, and their labels with track identities.
        config: of segmentation and tracker.
        network: classifies proposals.
        prior: classifies proposals by their boxes.
        ideal: objects have their true tracks.
    """
    odometry, tracker = Odometry(config.odometry), Tracker(config.tracking, ACCURATE)
    rows: dict[tuple[str, int], int] = {}
    frames = []
    for frame, scan in drive:
        proposals = Segmenter(config.segmentation, config.sensor, scan.fov).segment(frame.points)
        located = odometry.locate(frame, proposals, tracker.static_tracks)
        tracked = tracker.follow(frame.stamp_s, proposals, located)
        own, proposals = tracked.tracks, tracked.proposals
        ids = own.id[own.row_of_proposal(len(proposals))]
        keys = [
            ("body", body) if ideal and body != NONE else ("track", i)
            for i, body in zip(ids.tolist(), owners(scan, proposals).tolist(), strict=True)
        ]
        labels = label(scan, proposals)
        frames.append(
            RecordedFrame(
                proposals=proposals,
                box=transform_boxes(located.placement.T_world_sensor, proposals.box),
                track=np.array([rows.setdefault(key, len(rows)) for key in keys], np.int64),
                prior=prior.probability(proposals),
                likelihood=network.classify(frame.points, proposals, np.arange(len(proposals))),
                kind=labels.kind,
                scored=~labels.unknown & ~(labels.partial & ideal),
            )
        )
    return Recording(name, tuple(frames), len(rows), prior.pool_weight)


def owners(scan: Scan, proposals: Proposals) -> Int:
    """(P,) track identity of the object with most of a proposal's points; NONE without, and for smaller fragments."""
    of = proposals.label(len(scan.points))
    owner = np.full(len(proposals), NONE, np.int64)
    for members, track_id in zip(scan.objects, scan.track_ids, strict=True):
        own = of[members]
        shared = np.bincount(own[own != NONE], minlength=len(proposals))
        fragments = np.flatnonzero(shared > 0.5 * proposals.count)
        if len(fragments):
            owner[fragments[shared[fragments].argmax()]] = track_id
    return owner


class Playback:
    """Segmenter, odometry, tracker, classifier and prior of a pipeline that return the data of a recording.

    The track table has a row for each track of the drive from the first frame on.

    Args:
        recording: data to return.
        min_hits: minimum number of frames with a proposal before a track is classified.
    """

    state_names = ("followed",)

    def __init__(self, recording: Recording, min_hits: int) -> None:
        self._frames = iter(recording.frames)
        self._min_hits = min_hits
        self.pool_weight = recording.pool_weight
        self._tracks = Tracks.blank(recording.n_tracks)
        self._tracks.id[:] = np.arange(recording.n_tracks)

    def segment(self, points: Float32) -> Proposals:
        """Advance to the next frame; its proposals."""
        self._current = next(self._frames)
        return self._current.proposals

    def locate(self, frame: Frame, proposals: Proposals, static_tracks: Callable[[float], StaticTracks]) -> Located:
        """Placement at the origin; the recorded boxes are in the world."""
        placement = Placement(np.eye(4))
        return Located(placement, observe(proposals, placement.T_world_sensor))

    def static_tracks(self, stamp_s: float) -> StaticTracks:
        """Never called, since `locate` registers nothing."""
        raise NotImplementedError

    def follow(self, stamp_s: float, proposals: Proposals, located: Located) -> TrackedFrame:
        """Update the track table; tracks with enough hits whose class is not final want a class."""
        t, rows = self._tracks, self._current.track
        t.proposal[:] = NONE
        t.proposal[rows] = np.arange(len(rows))
        t.box[rows], t.points[rows] = self._current.box, proposals.count
        t.hits[rows] += 1
        t.age += t.hits > 0
        t.missed = np.where(t.proposal == NONE, t.missed + 1, 0)
        return TrackedFrame(t, proposals, (t.proposal != NONE) & ~t.final & (t.hits >= self._min_hits))

    def conclude(self, rows: Int, certain: Bool) -> Tracks:
        """A certain class is final."""
        self._tracks.final[rows] = certain
        return self._tracks

    def classify(self, points: Float32, proposals: Proposals, which: Int) -> Float64:
        """(R, 4) recorded likelihoods."""
        return self._current.likelihood[which]

    @property
    def frequency(self) -> Float64:
        """(4,) alike."""
        return np.full(N_CLASSES, 1 / N_CLASSES)

    def decide(self, tracks: Tracks) -> None:
        """Nothing: posteriors are judged."""

    def probability(self, proposals: Proposals) -> Float64:
        """(P, 4) recorded priors."""
        return self._current.prior

    def may_be_object(self, probability: Float64, threshold: float) -> Bool:
        """(M,) rows of priors (M, 4) with an object probability of at least `threshold`."""
        return object_probability_reaches(probability, threshold)

    def facts(self) -> dict[str, str]:
        """Empty: no model runs."""
        return {}
