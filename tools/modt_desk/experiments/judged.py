"""Replays of a drive, detector and tracker each ideal or real, and the tables of their judged frames."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from modt.app import assembly, kernel_choice
from modt.classification.scheduler import LinearCost, padded_each, padded_size
from modt.config import ClassificationConfig, ProfileConfig
from modt.energy.ledger import Ledger
from modt.geometry import FieldOfView
from modt.pipeline import Pipeline
from modt.types import NONE, FrameResult, Self
from modt_desk.evaluation.frame import JudgedFrame
from modt_desk.evaluation.matching import judge
from modt_desk.evaluation.rows import OBJECT, PROPOSAL, Rows, table
from modt_desk.evaluation.rules import Rules
from modt_desk.evaluation.truth import FrameTruth, Role
from modt_desk.experiments.drives import Drive
from modt_desk.experiments.ideal_tracker import IdealTracking
from modt_desk.experiments.segmented import PlayedBack, SegmentedDrive, SegmentedFrame, segmented

FRAME = np.dtype([("drive", int), ("frame", int), ("proposals", int)])
CALL = np.dtype([("drive", int), ("frame", int), ("track", int), ("points", int)])
"""One row for each classification; `points` are those that the network processes, padding included."""


@dataclass(frozen=True, slots=True)
class Judged:
    """Tables of one drive or of several."""

    frames: Rows
    objects: Rows
    proposals: Rows
    calls: Rows

    @classmethod
    def of_labels(cls, labels: Iterable[tuple[int, FrameTruth]]) -> Self:
        """Tables of labels alone: every labelled object is detected and followed by itself."""
        rows = []
        for frame, truth in labels:
            wanted = (truth.object_class > 0) & (truth.role != Role.IGNORED)
            range_m = np.hypot(*(truth.box[:, :2] - truth.T_box_sensor[:2, 3]).T)
            columns = {"class": truth.object_class, "role": truth.role, "id": truth.id, "track": truth.id}
            rows.append(table(OBJECT, len(truth.id), **columns, frame=frame, range_m=range_m, to_follow=wanted))
        objects = np.concatenate([np.zeros(0, OBJECT), *rows])
        frames = np.array([(0, row["frame"][0] if len(row) else NONE, len(row)) for row in rows], FRAME)
        return cls(frames, objects, np.zeros(0, PROPOSAL), np.zeros(0, CALL))

    @classmethod
    def of_results(
        cls,
        results: Iterable[tuple[FrameResult, SegmentedFrame]],
        fov: FieldOfView,
        rules: Rules,
        limits: ClassificationConfig,
    ) -> Self:
        """Tables of the results of a drive, judged by its labels."""
        frames, objects, proposals, calls = [], [], [], []
        for result, known in results:
            truth = known.truth
            seen, tracked, _ = judge(JudgedFrame.of_result(result, truth, fov), rules, points=known.objects)
            frames.append((0, result.frame.index, len(result.proposals)))
            objects.append(seen)
            proposals.append(tracked)
            calls.append(_calls(result, limits))
        return cls(
            np.array(frames, FRAME),
            np.concatenate([np.zeros(0, OBJECT), *objects]),
            np.concatenate([np.zeros(0, PROPOSAL), *proposals]),
            np.concatenate([np.zeros(0, CALL), *calls]),
        )

    @classmethod
    def pooled(cls, drives: Sequence[Judged]) -> Self:
        """Several drives, numbered in their tables."""
        tables = {f.name: [getattr(drive, f.name) for drive in drives] for f in fields(cls)}
        pooled = cls(**{name: np.concatenate(parts) for name, parts in tables.items()})
        for name, parts in tables.items():
            getattr(pooled, name)["drive"] = np.repeat(np.arange(len(parts)), [len(rows) for rows in parts])
        return pooled

    def within(self, range_m: float) -> Judged:
        """The objects within a range."""
        return replace(self, objects=self.objects[self.objects["range_m"] <= range_m])


def _calls(result: FrameResult, limits: ClassificationConfig) -> Rows:
    tracks = result.tracks
    rows = np.flatnonzero(np.isin(tracks.id, result.classified))
    points = padded_each(result.proposals.count[tracks.proposal[rows]], limits)
    return table(CALL, len(rows), frame=result.frame.index, track=tracks.id[rows], points=points)


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
