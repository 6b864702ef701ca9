"""The method: segment every frame, follow every proposal, classify only what is new or uncertain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from modt.energy.ledger import StageLedger
from modt.types import UNLIMITED, Bool, Budget, Float32, Float64, Frame, FrameResult, Int, Proposals, Tracks

SOURCE, SINK = "source", "sink"
SEGMENTATION, TRACKING, SCHEDULING, CLASSIFICATION, FUSION = STAGES = (
    "segmentation",
    "tracking",
    "scheduling",
    "classification",
    "fusion",
)
"""Names of the stages in the ledger."""


class Segmenter(Protocol):
    """Sweeps to proposals."""

    def segment(self, points: Float32) -> Proposals:
        """Proposals of (N, 4) points."""
        ...


class Tracker(Protocol):
    """Proposals to tracks."""

    @property
    def state_names(self) -> tuple[str, ...]:
        """Name of each value of tracks.state."""
        ...

    @property
    def proposals(self) -> Proposals:
        """Those followed last: the frame's, parted and joined where need be."""
        ...

    def follow(self, frame: Frame, proposals: Proposals) -> Tracks:
        """Predict, associate and update; afterwards every one of its proposals belongs to one track."""
        ...

    def asking(self) -> Bool:
        """(M,) tracks seen in this frame whose state asks for a class."""
        ...

    def settle(self, rows: Int, certain: Bool) -> None:
        """Tell the state machine of the classifications just made."""
        ...


class Selection(Protocol):
    """What the scheduler chose."""

    @property
    def rows(self) -> Int:
        """(R,) rows of the tracks to classify now."""
        ...

    @property
    def deferred(self) -> int:
        """Tracks that asked and must wait."""
        ...


class Scheduler(Protocol):
    """Keeps the frame's classifications within its budget."""

    def select(self, tracks: Tracks, proposals: Proposals, asks: Bool, budget: Budget) -> Selection:
        """The tracks to classify now, the most worthwhile first."""
        ...


class Classifier(Protocol):
    """Points to class likelihoods."""

    def classify(self, points: Float32, proposals: Proposals, which: Int) -> Float64:
        """(R, 4) P(Y|X) of the proposals named."""
        ...

    def facts(self) -> dict[str, str]:
        """Which model it is, for the record of a run."""
        ...


class Fusion(Protocol):
    """Which views count, and what they add up to."""

    def asks(self, tracks: Tracks, proposals: Proposals, asking: Bool) -> Bool:
        """(M,) tracks whose view of this frame is worth a classification."""
        ...

    def fuse(self, tracks: Tracks, proposals: Proposals, rows: Int, likelihood: Float64) -> Bool:
        """Write the posterior of the rows; (R,) whether each is certain now."""
        ...


@dataclass(frozen=True, slots=True)
class Pipeline:
    """The stages in their order; a mode of the method is a choice of these parts."""

    segmenter: Segmenter
    tracker: Tracker
    fusion: Fusion
    scheduler: Scheduler
    classifier: Classifier
    ledger: StageLedger

    def step(self, frame: Frame, budget: Budget = UNLIMITED) -> FrameResult:
        """One frame, within a budget of classifications (Figs. 2 and 5)."""
        run = self.ledger.run
        proposals = run(SEGMENTATION, self.segmenter.segment, frame.points)
        tracks = run(TRACKING, self.tracker.follow, frame, proposals)
        proposals = self.tracker.proposals
        asks = run(FUSION, self.fusion.asks, tracks, proposals, self.tracker.asking())
        chosen = run(SCHEDULING, self.scheduler.select, tracks, proposals, asks, budget)
        rows = chosen.rows
        if len(rows):
            likelihood = run(CLASSIFICATION, self.classifier.classify, frame.points, proposals, tracks.proposal[rows])
            certain = run(FUSION, self.fusion.fuse, tracks, proposals, rows, likelihood)
            self.tracker.settle(rows, certain)
        return FrameResult(frame, proposals, tracks.copy(), self.tracker.state_names, len(rows), chosen.deferred)
