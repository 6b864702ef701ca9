"""The ways in which a drive is replayed: detector and tracker each ideal or real."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Protocol

import numpy as np

from modt import assembly
from modt.classification.pointnet import PointNet
from modt.config import ClassificationConfig, ProfileConfig, SensorConfig
from modt.energy.ledger import NullLedger
from modt.evaluation.truth import FrameTruth
from modt.experiments.drives import Drive
from modt.experiments.ideal_tracker import IdealTracking, viewed, within
from modt.experiments.judged import Judged
from modt.experiments.segmented import SegmentedDrive, segmented
from modt.experiments.store import Store
from modt.pipeline import Pipeline
from modt.profile import dump
from modt.types import Float32, FrameResult, Proposals


class Replay(Protocol):
    """A way to replay a drive."""

    def described(self) -> dict[str, Any]:
        """All that its outcome follows from, but for drive and code."""

    def judged(self, drive: Drive, digest: str, store: Store) -> Judged:
        """What becomes of a drive of this digest; the store holds what replays share."""


@dataclass(frozen=True, slots=True)
class LabelReplay:
    """Ideal detector and tracker: the labels."""

    def described(self) -> dict[str, Any]:
        """Nothing but its kind."""
        return {"replay": "labels"}

    def judged(self, drive: Drive, digest: str, store: Store) -> Judged:
        """The labelled objects, each followed by itself."""
        return Judged.of_labels(sorted(drive.labels().items()))


@dataclass(frozen=True, slots=True)
class NetworkReplay:
    """The real detector: segmentation and network.

    Attributes:
        config: of the stages.
        mode: of the method.
        ideal: whether the tracker is.
        range_m: range of interest: what is farther is not there.
        poses: whether those of the drive are used.
    """

    config: ProfileConfig
    mode: str = "accurate"
    ideal: bool = False
    range_m: float = np.inf
    poses: bool = True

    def described(self) -> dict[str, Any]:
        """Model and resolved profile."""
        kept = {k: v for k, v in dump(self.config).items() if k not in ("energy", "loop", "recording")}
        facts = {"mode": self.mode, "ideal": self.ideal, "range_m": self.range_m, "poses": self.poses}
        model = _model(self.config.classification, self.config.sensor)
        return {"replay": "network", "profile": kept, "model": model, **facts}

    def judged(self, drive: Drive, digest: str, store: Store) -> Judged:
        """Step by step."""
        known = segmented(drive, digest, self.config, store)
        pipeline = self._pipeline(known, store)
        return Judged.of_results(self._results(pipeline, known), known.fov, known.rules, self.config.classification)

    def _pipeline(self, known: SegmentedDrive, store: Store) -> Pipeline:
        parts = assembly.pipeline(assembly.MODES[self.mode], self.config, known.fov, NullLedger())
        if not self.ideal:
            return replace(parts, segmenter=_Segmented(known, self.range_m))
        ideal = IdealTracking(viewed(known, self.config, store), self.range_m)
        return replace(parts, segmenter=ideal, odometry=ideal, tracker=ideal, classifier=ideal)

    def _results(self, pipeline: Pipeline, known: SegmentedDrive) -> Iterator[tuple[FrameResult, FrameTruth]]:
        budget = assembly.MODES[self.mode].budget(self.config)
        for made in known.frames:
            frame = made.frame if self.poses else replace(made.frame, T_world_sensor=None)
            yield pipeline.step(frame, budget), made.truth


@cache
def _model(config: ClassificationConfig, sensor: SensorConfig) -> dict[str, str]:
    return PointNet(config, sensor).facts()


class _Segmented:
    """The segmentation of a drive, played back."""

    def __init__(self, known: SegmentedDrive, range_m: float) -> None:
        self._proposals, self._range_m = (frame.proposals for frame in known.frames), range_m

    def facts(self) -> dict[str, str]:
        """No kernels."""
        return {"kernels": "none: played back"}

    def segment(self, points: Float32) -> Proposals:
        """Those of the next frame."""
        proposals = next(self._proposals)
        return proposals.take(np.flatnonzero(within(proposals, self._range_m)))
