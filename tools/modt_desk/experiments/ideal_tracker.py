"""The ideal tracker: proposals of a labelled object have its identity, whatever lies between.

The labels say nothing of background: its proposals, and further fragments of an object, are followed by the tracking
stage.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from modt.config import ProfileConfig
from modt.observations import Located, StaticTracks, observe
from modt.odometry.odometry import Odometry
from modt.placement import Placement
from modt.profile import dump
from modt.tracking.states import ACCURATE
from modt.tracking.tracker import Tracker
from modt.types import NONE, Bool, Float32, Float64, Frame, Int, Proposals, TrackedFrame, Tracks
from modt_desk.evaluation.frame import JudgedFrame
from modt_desk.evaluation.overlap import Overlap
from modt_desk.experiments.played_back import within
from modt_desk.experiments.segmented import SegmentedDrive, SegmentedFrame
from modt_desk.experiments.store import Store, key_of


@dataclass(frozen=True, slots=True)
class ViewedFrame:
    """A frame whose proposals are all classified and followed."""

    segmented: SegmentedFrame
    likelihood: Float64  # (P, 4) of the network
    track: Int  # (P,) row of the ideal track of each


def viewed(drive: SegmentedDrive, found: list[Float64], config: ProfileConfig, store: Store) -> list[ViewedFrame]:
    """Every proposal of a drive with the likelihood found and its ideal track; from the store where it was before."""
    described = dump(config)
    key = key_of("ideal tracks", drive.key, [described[name] for name in ("tracking", "odometry", "sensor")])
    tracks = store.made(key, lambda: dict(_tracks(drive, config)))
    return [ViewedFrame(*of, tracks[str(k)]) for k, of in enumerate(zip(drive.frames, found, strict=True))]


def _tracks(drive: SegmentedDrive, config: ProfileConfig) -> Iterator[tuple[str, Int]]:
    odometry = Odometry(config.odometry)
    tracker = Tracker(config.tracking, ACCURATE, regroupings=(), period_s=config.sensor.period_s)
    rows: dict[tuple[str, int], int] = {}
    for k, made in enumerate(drive.frames):
        frame, proposals = made.frame, made.proposals
        located = odometry.locate(frame, proposals, tracker.static_tracks)
        tracks = tracker.follow(frame.stamp_s, proposals, located).tracks
        own = tracks.id[tracks.row_of_proposal(len(proposals))].tolist()
        keys = [
            ("object", owner) if owner != NONE else ("other", i) for owner, i in zip(_owner(made), own, strict=True)
        ]
        yield str(k), np.array([rows.setdefault(key, len(rows)) for key in keys], np.int64)


def _owner(made: SegmentedFrame) -> list[int]:
    """(P,) identity of the object whose proposal each is, NONE for none."""
    truth, n = made.truth, len(made.proposals)
    none = np.zeros(0, np.int64)
    of_points = made.proposals.label(len(made.frame.points))
    blank = JudgedFrame(
        made.frame.index, made.frame.points, of_points, n, 0, none, none, none, np.zeros((0, 4)), truth
    )
    overlap = Overlap.of(blank, made.objects)
    found = np.flatnonzero((overlap.most > 0) & overlap.most_of_proposal)
    owner = np.full(n + 1, NONE, np.int64)
    owner[overlap.best[found]] = truth.id[found]
    owners: list[int] = owner[:n].tolist()
    return owners


class IdealTracking:
    """Segmenter, odometry, tracker and classifier of a pipeline that return what is known of a drive.

    Args:
        frames: of the drive.
        range_m: range of interest: what is farther is not there.
    """

    state_names = ("followed",)

    def __init__(self, frames: list[ViewedFrame], range_m: float = np.inf) -> None:
        self._frames, self._range_m = iter(frames), range_m
        self._tracks = Tracks.blank(1 + max((int(f.track.max(initial=-1)) for f in frames), default=-1))
        self._tracks.id[:] = np.arange(len(self._tracks))

    def segment(self, points: Float32) -> Proposals:
        """Those of the next frame."""
        self._now = next(self._frames)
        proposals = self._now.segmented.proposals
        self._which = np.flatnonzero(within(proposals, self._range_m))
        return proposals.take(self._which)

    def locate(self, frame: Frame, proposals: Proposals, static_tracks: Callable[[float], StaticTracks]) -> Located:
        """At the origin: nothing is associated by position."""
        origin = Placement(np.eye(4))
        return Located(origin, observe(proposals, origin.T_world_sensor))

    def static_tracks(self, stamp_s: float) -> StaticTracks:
        """Never asked for.

        Raises:
            NotImplementedError: always.
        """
        raise NotImplementedError

    def follow(self, stamp_s: float, proposals: Proposals, located: Located) -> TrackedFrame:
        """The table with a row for each track of the drive."""
        t, rows = self._tracks, self._now.track[self._which]
        t.proposal[:] = NONE
        t.proposal[rows] = np.arange(len(rows))
        t.points[rows] = proposals.count
        t.hits[rows] += 1
        t.age += t.hits > 0
        t.missed = np.where(t.proposal == NONE, t.missed + 1, 0)
        return TrackedFrame(t, proposals, (t.proposal != NONE) & ~t.final)

    def conclude(self, rows: Int, certain: Bool) -> Tracks:
        """A certain class is final."""
        self._tracks.final[rows] = certain
        return self._tracks.copy()

    def classify(self, points: Float32, proposals: Proposals, which: Int) -> Float64:
        """(R, 4) known likelihoods."""
        return self._now.likelihood[self._which[which]]

    def facts(self) -> dict[str, str]:
        """None: no model runs."""
        return {}
