"""Replays of a drive with an ideal or a real detector and tracker, and the tables of their judged frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from modt.app import assembly
from modt.classification.call_cost import LinearCost, padded_size
from modt.config import ProfileConfig
from modt.energy.ledger import Ledger
from modt.pipeline import Pipeline, SensorView
from modt.types import Self
from modt_evaluation.experiments.drives import Drive
from modt_evaluation.experiments.segmented import IdealTracking, PlayedBack, SegmentedDrive, segmented
from modt_evaluation.frame import JudgedFrame
from modt_evaluation.matching import judge
from modt_evaluation.rows import OBJECT, PROPOSAL, Rows, table
from modt_evaluation.truth import Role

FRAME = np.dtype([("drive", int), ("proposals", int)])
CALL = np.dtype([("drive", int), ("track", int)])
"""One row for each classification."""


@dataclass(frozen=True)
class Judged:
    """Tables of one drive or of several."""

    frames: Rows
    objects: Rows
    proposals: Rows
    calls: Rows

    @classmethod
    def joined(cls, parts: Sequence[Judged]) -> Self:
        """The tables of several parts in one."""
        return cls(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(cls)))

    @classmethod
    def pooled(cls, drives: Sequence[Judged]) -> Self:
        """Several drives, numbered in their tables."""
        pooled = cls.joined(drives)
        for f in fields(cls):
            lengths = [len(getattr(drive, f.name)) for drive in drives]
            getattr(pooled, f.name)["drive"] = np.repeat(np.arange(len(drives)), lengths)
        return pooled

    def within(self, range_m: float) -> Judged:
        """The objects within a range."""
        return replace(self, objects=self.objects[self.objects["range_m"] <= range_m])


@dataclass(frozen=True)
class LabelReplay:
    """Ideal detector and tracker: every labelled object is detected and followed by itself."""

    def judged(self, drive: Drive) -> Judged:
        """Tables of the labelled objects, without proposals and classifications."""
        rows = [np.zeros(0, OBJECT)]
        for frame, truth in sorted(drive.labels().items()):
            wanted = (truth.object_class > 0) & (truth.role != Role.IGNORED)
            columns = {"class": truth.object_class, "role": truth.role, "id": truth.id, "track": truth.id}
            rows.append(table(OBJECT, len(truth.id), **columns, frame=frame, range_m=truth.range_m, to_follow=wanted))
        frames = np.array([(0, len(row)) for row in rows[1:]], FRAME)
        return Judged(frames, np.concatenate(rows), np.zeros(0, PROPOSAL), np.zeros(0, CALL))


@dataclass(frozen=True)
class NetworkReplay:
    """Segmentation and network as the detector, without a budget of CPU time, whose effect depends on the machine.

    Attributes:
        config: profile of the stages.
        mode: mode of the method.
        ideal: whether the tracker is ideal.
        range_m: range of interest; proposals beyond it are left out.
    """

    config: ProfileConfig
    mode: str = "accurate"
    ideal: bool = False
    range_m: float = np.inf

    def judged(self, drive: Drive) -> Judged:
        """Tables of the drive, replayed frame by frame and judged by its labels."""
        known = segmented(drive, self.config)
        pipeline = self._pipeline(known)
        budget = replace(assembly.MODES[self.mode].budget(self.config), mean_ms=None)
        frames = [Judged(*(np.zeros(0, rows) for rows in (FRAME, OBJECT, PROPOSAL, CALL)))]
        for made in known.frames:
            result = pipeline.step(made.frame, budget)
            frame = JudgedFrame.of_result(result, made.truth, known.fov)
            rows = judge(frame, known.rules, points=made.objects)
            calls = table(CALL, len(result.classified), track=result.classified)
            frame_row = table(FRAME, 1, proposals=len(result.proposals))
            frames.append(Judged(frame_row, rows.objects, rows.proposals, calls))
        return Judged.joined(frames)

    def _pipeline(self, known: SegmentedDrive) -> Pipeline:
        config = self.config
        limits = config.classification
        mode = assembly.MODES[self.mode]
        cost = LinearCost(limits.max_points, padded_size(limits))
        kernels = assembly.chosen_kernels(config.segmentation.kernels)
        ideal = IdealTracking(known, config, self.range_m) if self.ideal else None
        played = ideal or PlayedBack(known, self.range_m)
        view = SensorView(assembly.leveller(config.sensor), played)
        pipeline = assembly.stages(mode, config, known.network, view, played, cost, Ledger(), kernels)
        return pipeline if ideal is None else replace(pipeline, odometry=ideal, tracker=ideal)


Replay = LabelReplay | NetworkReplay
