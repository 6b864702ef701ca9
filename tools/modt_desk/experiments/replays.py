"""Replays of a drive: detector and tracker each ideal or real."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from modt.app import assembly, kernel_choice
from modt.classification.scheduler import LinearCost, padded_size
from modt.config import ProfileConfig
from modt.energy.ledger import Ledger
from modt.pipeline import Pipeline
from modt.types import FrameResult
from modt_desk.experiments.drives import Drive
from modt_desk.experiments.ideal_tracker import IdealTracking
from modt_desk.experiments.judged import Judged
from modt_desk.experiments.segmented import PlayedBack, SegmentedDrive, SegmentedFrame, segmented


@dataclass(frozen=True, slots=True)
class LabelReplay:
    """Ideal detector and tracker: the labels."""

    def judged(self, drive: Drive) -> Judged:
        """The labelled objects, each followed by itself."""
        return Judged.of_labels(sorted(drive.labels().items()))


@dataclass(frozen=True, slots=True)
class NetworkReplay:
    """The real detector: segmentation and network, without a budget of CPU time, which no two machines fill alike.

    Attributes:
        config: profile of the stages.
        mode: mode of the method.
        ideal: whether the tracker is.
        range_m: range of interest; proposals beyond it are left out.
    """

    config: ProfileConfig
    mode: str = "accurate"
    ideal: bool = False
    range_m: float = np.inf

    def judged(self, drive: Drive) -> Judged:
        """Tables of the drive, replayed frame by frame."""
        known = segmented(drive, self.config)
        return Judged.of_results(self._results(known), known.fov, known.rules, self.config.classification)

    def _results(self, known: SegmentedDrive) -> Iterator[tuple[FrameResult, SegmentedFrame]]:
        pipeline = self._pipeline(known)
        budget = replace(assembly.MODES[self.mode].budget(self.config), mean_ms=None)
        for made in known.frames:
            yield pipeline.step(made.frame, budget), made

    def _pipeline(self, known: SegmentedDrive) -> Pipeline:
        config, limits, mode = self.config, self.config.classification, assembly.MODES[self.mode]
        cost = LinearCost(limits.max_points, padded_size(limits))
        kernels = kernel_choice.choose(config.segmentation.kernels)
        ideal = IdealTracking(known, config, self.range_m) if self.ideal else None
        played = ideal or PlayedBack(known, self.range_m)
        pipeline = assembly.stages(mode, config, known.network, played, played, cost, Ledger(), kernels)
        return pipeline if ideal is None else replace(pipeline, odometry=ideal, tracker=ideal)


Replay = LabelReplay | NetworkReplay
