"""The ideal tracker: proposals of a labelled object have its identity, whatever lies between.

The labels say nothing of background: its proposals, and further fragments of an object, are followed by the tracking
stage.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache

import numpy as np

from modt.config import OdometryConfig, ProfileConfig, TrackingConfig
from modt.observations import Located, StaticTracks, observe
from modt.odometry.odometry import Odometry
from modt.placement import Placement
from modt.tracking.states import ACCURATE
from modt.tracking.tracker import Tracker
from modt.types import NONE, Bool, Float32, Float64, Frame, Int, Proposals, TrackedFrame, Tracks
from modt_desk.evaluation.frame import JudgedFrame
from modt_desk.evaluation.overlap import Overlap
from modt_desk.experiments.segmented import SegmentedDrive, SegmentedFrame, within


@lru_cache(maxsize=2)
def _ideal_tracks(
    drive: SegmentedDrive, tracking: TrackingConfig, odometry: OdometryConfig, period_s: float
) -> tuple[Int, ...]:
    """(P,) row of the ideal track of each proposal, by frame; kept for the next settings of a sweep."""
    tracker = Tracker(
        replace(tracking, extensions="none"), ACCURATE, period_s=period_s
    )  # takes proposals as they are
    return tuple(_tracks(drive, tracker, Odometry(odometry)))


def _tracks(drive: SegmentedDrive, tracker: Tracker, odometry: Odometry) -> Iterator[Int]:
    rows: dict[tuple[str, int], int] = {}
    for made in drive.frames:
        frame, proposals = made.frame, made.proposals
        located = odometry.locate(frame, proposals, tracker.static_tracks)
        tracks = tracker.follow(frame.stamp_s, proposals, located).tracks
        own = tracks.id[tracks.row_of_proposal(len(proposals))].tolist()
        keys = [
            ("object", owner) if owner != NONE else ("other", i) for owner, i in zip(_owner(made), own, strict=True)
        ]
        yield np.array([rows.setdefault(key, len(rows)) for key in keys], np.int64)


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
        drive: segmented drive that is replayed.
        config: profile of the tracker that follows background and further fragments.
        range_m: range of interest; proposals beyond it are left out.
    """

    state_names = ("followed",)

    def __init__(self, drive: SegmentedDrive, config: ProfileConfig, range_m: float = np.inf) -> None:
        rows = _ideal_tracks(drive, config.tracking, config.odometry, config.sensor.period_s)
        self._frames, self._range_m = zip(drive.frames, rows, strict=True), range_m
        self._tracks = Tracks.blank(1 + max((int(row.max(initial=-1)) for row in rows), default=-1))
        self._tracks.id[:] = np.arange(len(self._tracks))

    def segment(self, points: Float32) -> Proposals:
        """Proposals of the next frame."""
        self._now, self._rows = next(self._frames)
        proposals = self._now.proposals
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
        t, rows = self._tracks, self._rows[self._which]
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
