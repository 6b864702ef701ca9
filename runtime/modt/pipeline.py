"""The method: segment every frame, follow every proposal, classify only what is new or uncertain."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from modt.classification.scheduler import Scheduler
from modt.energy.ledger import STAGES as LEDGER_STAGES
from modt.energy.ledger import Ledger
from modt.observations import Located, StaticTracks
from modt.placement import Placement
from modt.sensor_fit.levelling import Leveller
from modt.types import (
    UNLIMITED,
    Bool,
    Budget,
    Decisions,
    Evidence,
    Float32,
    Float64,
    Frame,
    FrameResult,
    Int,
    Motion,
    ObjectBoxes,
    Proposals,
    TrackedFrame,
    Tracks,
)

SOURCE, *_, SINK = LEDGER_STAGES
SEGMENTATION, ODOMETRY, TRACKING, SCHEDULING, CLASSIFICATION, FUSION = STAGES = LEDGER_STAGES[1:-1]
"""Names of the stages in the ledger."""
_NONE_CONFIRMED: Bool = np.zeros(0, np.bool_)


class SegmentationStage(Protocol):
    """Sweeps to proposals."""

    def segment(self, points: Float32) -> Proposals:
        """Proposals of (N, 4) points."""

    def leave_out(self, dead_deg: tuple[float, ...]) -> None:
        """Take the beams of these elevations for dead, and all others for alive."""

    def facts(self) -> dict[str, str]:
        """Kernels of the segmenter, for the record of a run."""


class ViewStage(Protocol):
    """Views of the sensors of a robot on a frame: the frame made level, and its proposals."""

    def level(self, frame: Frame) -> Frame:
        """The frame in the level frame in which the stages work."""

    def segment(self, frame: Frame) -> Proposals:
        """Proposals of a level frame."""

    def leave_out(self, dead_deg: tuple[float, ...]) -> None:
        """Take the beams of these elevations for dead, and all others for alive."""

    def finish(self, result: FrameResult, placement: Placement) -> FrameResult:
        """The result in the frame in which it is given to others; `placement` is that of the level frame."""

    def facts(self) -> dict[str, str]:
        """Kernels of the segmenter, for the record of a run."""


@dataclass(eq=False)
class SensorView:
    """The view of one sensor, whose level frame is that of the results."""

    leveller: Leveller
    segmenter: SegmentationStage

    def level(self, frame: Frame) -> Frame:
        """The sweep turned level."""
        return self.leveller.level(frame)

    def segment(self, frame: Frame) -> Proposals:
        """Proposals of the points of a level sweep."""
        return self.segmenter.segment(frame.points)

    def leave_out(self, dead_deg: tuple[float, ...]) -> None:
        """Take the beams of these elevations for dead, and all others for alive."""
        self.segmenter.leave_out(dead_deg)

    def finish(self, result: FrameResult, placement: Placement) -> FrameResult:
        """The result as it is."""
        return result

    def facts(self) -> dict[str, str]:
        """Kernels of the segmenter."""
        return self.segmenter.facts()


class OdometryStage(Protocol):
    """Proposals to the world."""

    def locate(self, frame: Frame, proposals: Proposals, static_tracks: Callable[[float], StaticTracks]) -> Located:
        """Placement of the frame and observations of its proposals."""


class TrackingStage(Protocol):
    """Observations to tracks."""

    @property
    def state_names(self) -> tuple[str, ...]:
        """Name of each value of tracks.state."""

    def static_tracks(self, stamp_s: float) -> StaticTracks:
        """Tracks that a frame at this time may continue, as the odometry needs them; deletes those ended by a gap."""

    def track(self, stamp_s: float, proposals: Proposals, located: Located, points: Float32) -> TrackedFrame:
        """Predict, associate and update; afterwards every proposal belongs to one track."""

    def confirm(self, rows: Int, confirmed: Bool) -> Tracks:
        """Advance the states of the classified rows (R,), and return a snapshot of all tracks."""


class ClassificationStage(Protocol):
    """Points to class probabilities."""

    def classify(self, points: Float32, proposals: Proposals, which: Int) -> Float64:
        """(R, C) P(class | points) of the proposals named, under the class frequency that the classifier assumes."""

    def facts(self) -> dict[str, str]:
        """Name and hash of the model, for the record of a run."""


class FusionStage(Protocol):
    """Views to posteriors."""

    def observe(self, evidence: Evidence, motion: Motion, proposals: Proposals) -> None:
        """Write what boxes and motion of this frame tell of the classes."""

    def asks(self, evidence: Evidence, motion: Motion, proposals: Proposals, wants_class: Bool) -> Bool:
        """(M,) tracks whose view of this frame is worth a classification."""

    def fuse(self, evidence: Evidence, motion: Motion, proposals: Proposals, rows: Int, probability: Float64) -> Bool:
        """Add the class probabilities (R, C) of the rows (R,) to their posteriors; returns (R,) those confirmed."""


class DecisionStage(Protocol):
    """Posteriors to reported classes."""

    frequency: Float64
    """(C,) frequencies of the classes among the proposals, as estimated so far."""

    def decide(self, decisions: Decisions, evidence: Evidence, motion: Motion) -> None:
        """Write the reported class of every track."""


class BoxStage(Protocol):
    """Boxes of proposals to boxes of whole objects."""

    def estimate(
        self, own: ObjectBoxes, motion: Motion, decisions: Decisions, proposals: Proposals, placement: Placement
    ) -> None:
        """Write the whole box of every track."""


@dataclass(frozen=True)
class Pipeline:
    """The stages in their order; a mode of the method is a choice of these parts."""

    view: ViewStage
    odometry: OdometryStage
    tracker: TrackingStage
    fusion: FusionStage
    scheduler: Scheduler
    classifier: ClassificationStage
    decision: DecisionStage
    boxes: BoxStage
    ledger: Ledger

    def step(self, frame: Frame, budget: Budget = UNLIMITED) -> FrameResult:
        """Process a frame within a budget of classifications (Figs. 2 and 5 of the paper)."""
        run = self.ledger.run
        frame = self.view.level(frame)
        proposals = run(SEGMENTATION, self.view.segment, frame)
        located = run(ODOMETRY, self.odometry.locate, frame, proposals, self.tracker.static_tracks)
        tracked = run(TRACKING, self.tracker.track, frame.time_s, proposals, located, frame.points)
        proposals = tracked.proposals
        motion = tracked.motion
        evidence = tracked.evidence  # shares its arrays with own_evidence, so it shows what the fusion writes
        run(FUSION, self.fusion.observe, tracked.own_evidence, motion, proposals)
        asks = run(FUSION, self.fusion.asks, evidence, motion, proposals, tracked.wants_class)
        chosen = run(SCHEDULING, self.scheduler.select, tracked.requests, motion, evidence, proposals, asks, budget)
        rows = chosen.rows
        confirmed = _NONE_CONFIRMED
        if len(rows):
            probability = self._classify(frame.points, proposals, motion.proposal[rows], budget)
            confirmed = run(FUSION, self.fusion.fuse, tracked.own_evidence, motion, proposals, rows, probability)
        run(FUSION, self.decision.decide, tracked.decisions, evidence, motion)
        run(TRACKING, self.boxes.estimate, tracked.boxes, motion, tracked.decisions, proposals, located.placement)
        # Last, since it takes the snapshot of all columns, the reported class among them.
        tracks = run(TRACKING, self.tracker.confirm, rows, confirmed)
        placement = located.placement
        result = FrameResult(
            frame=frame,
            T_world_sensor=placement.T_world_sensor,
            # The boxes until here are as seen during the sweep. The result has them as they are at its stamp.
            proposals=replace(proposals, box=placement.at_stamp(proposals.centroid, proposals.box)),
            tracks=tracks,
            state_names=self.tracker.state_names,
            n_deferred=chosen.n_deferred,
            classified=tracks.id[rows],
        )
        return self.view.finish(result, placement)

    def _classify(self, points: Float32, proposals: Proposals, which: Int, budget: Budget) -> Float64:
        """(R, C) class probabilities. The ledger counts points; the scheduler learns the cost if time is limited."""
        cost = self.scheduler.cost
        count = proposals.count[which]
        classify = self.classifier.classify
        probability, cpu_ns = self.ledger.timed(CLASSIFICATION, classify, points, proposals, which)
        self.ledger.count(CLASSIFICATION, points=cost.size(count))
        if budget.cpu_ms is not None or budget.mean_ms is not None:
            self.scheduler.record_cost(count, cpu_ns / 1e6)
        return probability
