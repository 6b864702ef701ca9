"""The ways in which a drive is replayed: detector and tracker each ideal or real."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Protocol

import numpy as np

from modt.app import assembly, kernel_choice
from modt.classification.pointnet import PointNet
from modt.classification.scheduler import LinearCost, padded_size
from modt.config import ClassificationConfig, ProfileConfig, SensorConfig
from modt.energy.ledger import NullLedger
from modt.pipeline import Classifier, Pipeline, Segmenter
from modt.profile import dump
from modt.types import FrameResult
from modt_desk.experiments.drives import Drive
from modt_desk.experiments.ideal_tracker import IdealTracking, viewed
from modt_desk.experiments.judged import Judged
from modt_desk.experiments.played_back import PlayedBack, likelihoods
from modt_desk.experiments.segmented import SegmentedDrive, SegmentedFrame, segmented
from modt_desk.experiments.store import Store


class Replay(Protocol):
    """A way to replay a drive."""

    def described(self) -> dict[str, Any]:
        """All that its outcome follows from, but for drive and code."""

    def basis(self) -> dict[str, Any]:
        """All that its first stages follow from: what replays have in common, the first of them makes."""

    def judged(self, drive: Drive, digest: str, store: Store) -> Judged:
        """What becomes of a drive of this digest; the store holds what replays share."""


@dataclass(frozen=True, slots=True)
class LabelReplay:
    """Ideal detector and tracker: the labels."""

    def described(self) -> dict[str, Any]:
        """Nothing but its kind."""
        return {"replay": "labels"}

    def basis(self) -> dict[str, Any]:
        """None but the labels."""
        return {}

    def judged(self, drive: Drive, digest: str, store: Store) -> Judged:
        """The labelled objects, each followed by itself."""
        return Judged.of_labels(sorted(drive.labels().items()))


@dataclass(frozen=True, slots=True)
class NetworkReplay:
    """The real detector: segmentation and network, without a budget of CPU time, which no two machines fill alike.

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
        return {"replay": "network", "profile": kept, "model": self._network.facts(), **facts}

    def basis(self) -> dict[str, Any]:
        """Segmentation and network."""
        return {k: v for k, v in dump(self.config).items() if k in ("sensor", "segmentation", "classification")}

    def judged(self, drive: Drive, digest: str, store: Store) -> Judged:
        """Step by step."""
        known = segmented(drive, digest, self.config, store)
        pipeline = self._pipeline(known, store)
        return Judged.of_results(self._results(pipeline, known), known.fov, known.rules, self.config.classification)

    def _pipeline(self, known: SegmentedDrive, store: Store) -> Pipeline:
        found = likelihoods(known, self._network, self.config, store)
        if not self.ideal:
            played = PlayedBack(known, found, self._network, self.range_m)
            return self._stages(played, played)
        ideal = IdealTracking(viewed(known, found, self.config, store), self.range_m)
        return replace(self._stages(ideal, ideal), odometry=ideal, tracker=ideal)

    def _stages(self, segmenter: Segmenter, classifier: Classifier) -> Pipeline:
        config, limits = self.config, self.config.classification
        cost = LinearCost(limits.max_points, padded_size(limits), config.scheduler.cost)
        mode, kernels = assembly.MODES[self.mode], kernel_choice.choose(config.segmentation.kernels)
        return assembly.stages(mode, config, self._network, segmenter, classifier, cost, NullLedger(), kernels)

    @property
    def _network(self) -> PointNet:
        return _network(self.config.classification, self.config.sensor)

    def _results(self, pipeline: Pipeline, known: SegmentedDrive) -> Iterator[tuple[FrameResult, SegmentedFrame]]:
        budget = replace(assembly.MODES[self.mode].budget(self.config), cpu_ms=None)
        for made in known.frames:
            frame = made.frame if self.poses else replace(made.frame, T_world_sensor=None)
            yield pipeline.step(frame, budget), made


@cache
def _network(config: ClassificationConfig, sensor: SensorConfig) -> PointNet:
    return PointNet(config, sensor)
