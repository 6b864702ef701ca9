"""Segmentation and classification of a drive, which all settings of tracking and fusion share, and its playback.

A frame keeps only the points of its proposals and those near the boxes of labelled objects: neither stage nor
judgement looks at the others. With the ideal tracker, proposals of a labelled object have its identity, whatever lies
between. The labels say nothing of background: its proposals, and further fragments of an object, are followed by the
tracking stage.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, lru_cache

import numpy as np

from modt.app import assembly
from modt.classification.pointnet import PointNet
from modt.config import ClassificationConfig, ProfileConfig, SensorConfig, TrackingConfig
from modt.geometry import FieldOfView
from modt.observations import Located, StaticTracks, observe
from modt.odometry.pose_estimator import PoseEstimator
from modt.placement import Placement
from modt.tracking.states import ACCURATE
from modt.tracking.tracker import Tracker
from modt.types import (
    NONE,
    Bool,
    Decisions,
    Evidence,
    Float32,
    Float64,
    Frame,
    Int,
    Motion,
    ObjectBoxes,
    Proposals,
    Requests,
    TrackedFrame,
    Tracks,
    copy_runs,
)
from modt_evaluation.experiments.drives import Drive
from modt_evaluation.frame import JudgedFrame
from modt_evaluation.overlap import ObjectPoints, Overlap
from modt_evaluation.rules import Rules
from modt_evaluation.truth import FrameTruth


@dataclass(frozen=True)
class SegmentedFrame:
    """A sweep with its proposals, their likelihoods, labels, and the points of objects."""

    frame: Frame
    proposals: Proposals
    likelihood: Float64  # (P, 4) of the network
    truth: FrameTruth
    objects: ObjectPoints


@dataclass(frozen=True, eq=False)
class SegmentedDrive:
    """All sweeps of a drive, with the segmented field of view and the rules of the judgement."""

    frames: tuple[SegmentedFrame, ...]
    network: PointNet
    fov: FieldOfView
    rules: Rules


def segmented(drive: Drive, config: ProfileConfig) -> SegmentedDrive:
    """The drive, segmented and classified as configured; the last one is kept for the next setting."""
    needed = ProfileConfig(
        sensor=config.sensor, segmentation=config.segmentation, classification=config.classification
    )
    return _segmented(drive, needed)


@lru_cache(maxsize=1)
def _segmented(drive: Drive, config: ProfileConfig) -> SegmentedDrive:
    network = _network(config.classification, config.sensor)
    return SegmentedDrive(tuple(_frames(drive, config, network)), network, drive.fov(), drive.rules())


@cache
def _network(config: ClassificationConfig, sensor: SensorConfig) -> PointNet:
    return assembly.network(config, sensor)


def _frames(drive: Drive, config: ProfileConfig, network: PointNet) -> Iterator[SegmentedFrame]:
    segmenter = assembly.segmenter(config, drive.fov(), assembly.chosen_kernels(config.segmentation.kernels))
    for frame, truth in drive.sweeps():
        proposals = segmenter.segment(frame.points)
        likelihood = network.classify(frame.points, proposals, np.arange(len(proposals)))
        yield SegmentedFrame(frame, proposals, likelihood, truth, ObjectPoints.of(frame.points, truth))


def within(proposals: Proposals, range_m: float) -> Bool:
    """(P,) proposals within a range."""
    return np.asarray(np.hypot(proposals.centroid[:, 0], proposals.centroid[:, 1]) <= range_m)


def chosen(proposals: Proposals, which: Int) -> Proposals:
    """A copy of the proposals of the numbers given, in their order."""
    runs = np.stack([proposals.offsets[which], proposals.offsets[which + 1]])
    copied = copy_runs(proposals.members, proposals.coordinates, runs)
    return proposals.regrouped(*copied, proposals.count[which], which)


@lru_cache(maxsize=2)
def _ideal_tracks(drive: SegmentedDrive, tracking: TrackingConfig, period_s: float) -> tuple[Int, ...]:
    """(P,) row of the ideal track of each proposal, by frame; kept for the next settings of a sweep."""
    tracker = Tracker(replace(tracking, extensions="none"), ACCURATE, period_s=period_s)  # joins no proposals
    return tuple(_tracks(drive, tracker, PoseEstimator()))


def _tracks(drive: SegmentedDrive, tracker: Tracker, odometry: PoseEstimator) -> Iterator[Int]:
    rows: dict[tuple[str, int], int] = {}
    for made in drive.frames:
        located = odometry.locate(made.frame, made.proposals, tracker.static_tracks)
        motion = tracker.track(made.frame.stamp_s, made.proposals, located).motion
        id_of_proposal = motion.id[motion.row_of_proposal(len(made.proposals))].tolist()
        objects = _object_of_proposal(made)
        keys = [("object", k) if k != NONE else ("other", i) for k, i in zip(objects, id_of_proposal, strict=True)]
        yield np.array([rows.setdefault(key, len(rows)) for key in keys], np.int64)


def _object_of_proposal(made: SegmentedFrame) -> list[int]:
    """(P,) identity of the object that each proposal stands for, NONE for none."""
    n = len(made.proposals)
    proposal = made.proposals.label(len(made.frame.points))
    blank = JudgedFrame.without_tracks(made.frame.index, made.frame.points, proposal, n, made.truth)
    overlap = Overlap.of(blank, made.objects)
    found = np.flatnonzero((overlap.most > 0) & overlap.most_of_proposal)
    object_of_proposal = np.full(n + 1, NONE, np.int64)
    object_of_proposal[overlap.best[found]] = made.truth.id[found]
    identities: list[int] = object_of_proposal[:n].tolist()
    return identities


class PlayedBack:
    """Segmenter and classifier of a pipeline that gives the proposals of a segmented drive.

    Args:
        drive: segmented drive that is played back.
        range_m: range of interest; proposals beyond it are left out.
    """

    def __init__(self, drive: SegmentedDrive, range_m: float = np.inf) -> None:
        self._frames = iter(drive.frames)
        self._range_m = range_m
        self._network = drive.network

    def segment(self, points: Float32) -> Proposals:
        """Proposals of the next frame."""
        self._now = next(self._frames)
        self._which = np.flatnonzero(within(self._now.proposals, self._range_m))
        return chosen(self._now.proposals, self._which)

    def classify(self, points: Float32, proposals: Proposals, which: Int) -> Float64:
        """(R, 4) likelihoods of the network."""
        return self._network.classify(points, proposals, which)

    def leave_out(self, dead_deg: tuple[float, ...]) -> None:
        """Change nothing: the proposals are recorded."""

    def facts(self) -> dict[str, str]:
        """Facts of the network."""
        return self._network.facts()


class IdealTracking(PlayedBack):
    """Segmenter, odometry, tracker and classifier of a pipeline that return the truth of a drive.

    The tracker of the profile follows background and further fragments; proposals beyond a range are left out.
    """

    state_names = ("followed",)

    def __init__(self, drive: SegmentedDrive, config: ProfileConfig, range_m: float) -> None:
        super().__init__(drive, range_m)
        rows = _ideal_tracks(drive, config.tracking, config.sensor.period_s)
        self._rows = iter(rows)
        self._tracks = Tracks.blank(1 + max((int(row.max(initial=-1)) for row in rows), default=-1))
        self._tracks.id[:] = np.arange(len(self._tracks))

    def locate(self, frame: Frame, proposals: Proposals, static_tracks: Callable[[float], StaticTracks]) -> Located:
        """The origin, since nothing is associated by position."""
        origin = Placement(np.eye(4))
        return Located(origin, observe(proposals, origin.T_world_sensor))

    def static_tracks(self, stamp_s: float) -> StaticTracks:
        """None, since nothing is registered."""
        nothing = np.zeros(0, np.bool_)
        return StaticTracks(
            id=np.zeros(0, np.int64),
            observed=nothing,
            stationary=nothing,
            candidate=nothing,
            kdop=np.zeros((0, 8)),
            predicted_kdop=np.zeros((8, 0)),
        )

    def track(
        self, stamp_s: float, proposals: Proposals, located: Located, points: Float32 | None = None
    ) -> TrackedFrame:
        """The table with a row for each track of the drive."""
        t = self._tracks
        rows = next(self._rows)[self._which]
        t.proposal[:] = NONE
        t.proposal[rows] = np.arange(len(rows))
        t.points[rows] = proposals.count
        t.hits[rows] += 1
        t.age[t.hits > 0] += 1
        t.missed[:] = np.where(t.proposal == NONE, t.missed + 1, 0)
        return TrackedFrame(
            motion=Motion.of(t),
            evidence=Evidence.of(t),
            own_evidence=Evidence.of(t),
            requests=Requests.of(t),
            decisions=Decisions.of(t),
            boxes=ObjectBoxes.of(t),
            proposals=proposals,
            wants_class=t.observed & ~t.final,
        )

    def confirm(self, rows: Int, confirmed: Bool) -> Tracks:
        """Make the confirmed classes final."""
        self._tracks.final[rows] = confirmed
        return self._tracks.copy()

    def classify(self, points: Float32, proposals: Proposals, which: Int) -> Float64:
        """(R, 4) known likelihoods."""
        return self._now.likelihood[self._which[which]]
