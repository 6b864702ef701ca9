"""Promises that hold after every frame, whatever it was."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any
from unittest.mock import patch

import numpy as np

from modt import profile
from modt.app import assembly
from modt.classification.pointnet import PointNet
from modt.classification.scheduler import Scheduler, Selection
from modt.classification.tuning import ClassificationTuning
from modt.config import ClassificationConfig, ProfileConfig, SensorConfig, TrackingConfig
from modt.energy.ledger import Ledger, LedgerLine
from modt.geometry import FieldOfView
from modt.model_file import ModelFile
from modt.sinks.records import line
from modt.sinks.tracks import frame_line
from modt.types import NONE, Budget, Frame, FrameResult, PointKind

LONGEST_UNSEEN = 10
"""A track is kept unseen for at most this many times `max_missed` frames, however small their steps in time."""
_CALL_POINTS = np.full(8, 100)


@dataclass
class Clock:
    """A clock of a test [ns]: the same calls give the same readings, some of which stand still or go back."""

    back: int = 0
    _calls: int = 0
    _now: int = 0

    def __call__(self) -> int:
        self._calls += 1
        self._now += 1_000 * (self._calls % 7) - self.back * (self._calls % 11 == 0)
        return self._now


class Watched:
    """A scheduler whose grants are held against the budget."""

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self.cost = scheduler.cost
        self._frames = 0
        self._spent_ms = 0.0

    def record_cost(self, points: Any, cpu_ms: float) -> None:
        self._spent_ms += max(cpu_ms, 0.0)
        self._scheduler.record_cost(points, cpu_ms)

    def select(
        self, requests: Any, motion: Any, evidence: Any, proposals: Any, asks: Any, budget: Budget
    ) -> Selection:
        chosen = self._scheduler.select(requests, motion, evidence, proposals, asks, budget)
        points = proposals.count[motion.proposal[chosen.rows]]
        assert len(set(chosen.rows.tolist())) == len(chosen.rows)
        assert asks[chosen.rows].all()
        assert len(chosen.rows) + chosen.n_deferred == np.count_nonzero(asks & motion.observed)
        assert budget.calls is None or len(chosen.rows) <= budget.calls
        if budget.cpu_ms is not None and len(points):
            assert self.cost.cost_ms(points) <= budget.cpu_ms or (self.cost.outdated and len(points) == 1)
        self._frames += 1
        if budget.mean_ms is not None and len(points):  # only what is saved is spent, or one call on credit
            assert self._spent_ms <= budget.mean_ms * self._frames + 1e-9
            assert (
                len(points) == 1 or self.cost.cost_ms(points) <= budget.mean_ms * self._frames - self._spent_ms + 1e-9
            )
        return chosen


@cache
def config(sensor: str, association: str) -> ProfileConfig:
    """A shipped profile with an association."""
    found = profile.resolve((sensor,)).config
    return replace(found, tracking=replace(found.tracking, association=association))


@cache
def _network(config: ClassificationConfig, sensor: SensorConfig, tuning: ClassificationTuning) -> PointNet:
    return PointNet(ModelFile.find(config.model), config, sensor, tuning)


def _warm_up(classify: Any, cost: Any, *_: Any) -> None:
    cost.warmed_up(_CALL_POINTS, 1.0)


@dataclass
class Run:
    """A pipeline with its promises, and what it has written so far."""

    mode: str
    config: ProfileConfig
    budget: Budget
    back: int = 0
    text: str = ""
    proposals: list[int] = field(default_factory=list)
    _before: frozenset[int] = frozenset()
    _next_id: int = 0

    def __post_init__(self) -> None:
        with patch.multiple(assembly, network=_network, warm_up=_warm_up):
            ledger = Ledger(Clock(self.back), Clock(self.back))
            made = assembly.pipeline(assembly.MODES[self.mode], self.config, FieldOfView(), ledger)
        self.pipeline = replace(made, scheduler=Watched(made.scheduler))  # type: ignore[arg-type]

    def step(self, frame: Frame) -> FrameResult:
        """One frame, after which all promises are kept."""
        result = self.pipeline.step(frame, self.budget)
        book = self.pipeline.ledger.close_frame(frame.index)
        self.proposals.append(len(result.proposals))
        self._proposals_are_of_the_frame(result)
        self._bounded(result)
        self._tracks(result)
        self._labels(result)
        self._posteriors(result)
        self._placed(result)
        self._parts_are_the_whole(book)
        self.text += frame_line(result) + line(book)
        return result

    def _proposals_are_of_the_frame(self, result: FrameResult) -> None:
        found = result.proposals
        assert found.offsets[0] == 0
        assert (found.count > 0).all()
        assert found.offsets[-1] == len(found.members) == len(np.unique(found.members))
        assert not len(found.members) or 0 <= found.members.min() <= found.members.max() < len(result.frame.points)
        assert np.isfinite(found.box).all()
        assert np.isfinite(found.centroid).all()

    def _tracks(self, result: FrameResult) -> None:
        tracks = result.tracks
        ids = result.tracks.id.tolist()
        own = tracks.proposal[tracks.proposal != NONE]
        assert sorted(own.tolist()) == list(range(len(result.proposals)))  # every proposal has one track
        assert len(set(ids)) == len(ids)
        assert ((tracks.missed > 0) == (tracks.proposal == NONE)).all()
        new = set(ids) - self._before
        assert all(number >= self._next_id for number in new)  # no identity comes back
        self._before = frozenset(ids)
        self._next_id = max([self._next_id - 1, *ids]) + 1
        assert set(result.classified.tolist()) <= set(tracks.id[tracks.proposal != NONE].tolist())
        for name, column in tracks.columns().items():
            assert np.isfinite(column).all(), name

    def _labels(self, result: FrameResult) -> None:
        """Every point has one label: its kind, or a track that is seen; members have the track of their proposal."""
        labels = result.labels
        kind = result.proposals.kind
        assert kind is not None
        proposal_of_point = result.proposals.label(len(result.frame.points))
        assert labels.shape == kind.shape == proposal_of_point.shape
        member = proposal_of_point != NONE
        assert ((kind == PointKind.MEMBER) == member).all()
        row_of_proposal = result.tracks.row_of_proposal(len(result.proposals))
        seen = result.tracks.id[row_of_proposal]
        assert (labels[member] == seen[proposal_of_point[member]]).all()
        reasons = [reason.value for reason in PointKind if reason != PointKind.MEMBER]
        assert np.isin(labels[~member], [*reasons, *seen]).all()
        foot = kind == PointKind.FOOT  # labelled as what it is part of
        assert (labels == kind)[~member & ~foot].all()
        left_out = sum(result.left_out().values())
        assert left_out + len(result.proposals.members) + np.count_nonzero(foot) == len(labels)

    def _posteriors(self, result: FrameResult) -> None:
        tracks = result.tracks
        frequency = self.pipeline.decision.frequency
        for column in (tracks.prior, tracks.posterior, frequency[None]):
            assert (column >= 0).all()
            np.testing.assert_allclose(column.sum(axis=1), 1.0, rtol=0, atol=1e-9)

    def _placed(self, result: FrameResult) -> None:
        R = result.T_world_sensor[:3, :3]
        assert np.isfinite(result.T_world_sensor).all()
        np.testing.assert_allclose(R @ R.T, np.eye(3), rtol=0, atol=1e-6)

    def _bounded(self, result: FrameResult) -> None:
        """Nothing is remembered but what recent frames have shown."""
        assert len(result.tracks) <= sum(self.proposals[-most_frames(self.config.tracking) :])
        landmarks: Any = self.pipeline.odometry._landmarks  # type: ignore[attr-defined]
        assert set(landmarks._id.tolist()) <= self._before

    def _parts_are_the_whole(self, book: LedgerLine) -> None:
        parts = [work.wall_ns for work in book.stages.values()]
        assert book.wall_ns == sum(parts) + book.overhead_ns + book.idle_ns
        assert min([book.overhead_ns, book.idle_ns, book.cpu_ns, *parts]) >= 0


def most_frames(tracking: TrackingConfig) -> int:
    """Frames after which a track that is not seen is gone for certain."""
    return LONGEST_UNSEEN * (tracking.max_missed + 2)
