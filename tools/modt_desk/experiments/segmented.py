"""Segmentation and classification of a drive, which all settings of tracking and fusion share.

A frame keeps only the points of its proposals and those near the boxes of labelled objects: neither stage nor
judgement looks at the others.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache, lru_cache

import numpy as np

from modt.app import assembly, kernel_choice
from modt.classification.pointnet import PointNet
from modt.config import ClassificationConfig, ProfileConfig, SensorConfig
from modt.geometry import FieldOfView
from modt.types import Bool, Float32, Float64, Frame, Proposals
from modt_desk.evaluation.overlap import PAD_M, ObjectPoints, in_box_frame, inside
from modt_desk.evaluation.rules import Rules
from modt_desk.evaluation.truth import FrameTruth
from modt_desk.experiments.drives import Drive


@dataclass(frozen=True, slots=True)
class SegmentedFrame:
    """A sweep: the points that matter, proposals and their likelihoods, labels, and the points of its objects."""

    frame: Frame
    proposals: Proposals
    likelihood: Float64  # (P, 4) of the network
    truth: FrameTruth
    objects: ObjectPoints


@dataclass(frozen=True, slots=True, eq=False)
class SegmentedDrive:
    """All sweeps of a drive, with the field of view that was segmented and the rules of their judgement."""

    frames: tuple[SegmentedFrame, ...]
    network: PointNet
    fov: FieldOfView
    rules: Rules


def segmented(drive: Drive, config: ProfileConfig) -> SegmentedDrive:
    """The drive, segmented and classified as configured; the last one is kept for the next setting."""
    return _segmented(
        drive,
        ProfileConfig(sensor=config.sensor, segmentation=config.segmentation, classification=config.classification),
    )


@lru_cache(maxsize=1)
def _segmented(drive: Drive, config: ProfileConfig) -> SegmentedDrive:
    network = _network(config.classification, config.sensor)
    return SegmentedDrive(tuple(_frames(drive, config, network)), network, drive.fov(), drive.rules())


@cache
def _network(config: ClassificationConfig, sensor: SensorConfig) -> PointNet:
    return PointNet(config, sensor)


def _frames(drive: Drive, config: ProfileConfig, network: PointNet) -> Iterator[SegmentedFrame]:
    segmenter = assembly.segmenter(config, drive.fov(), kernel_choice.choose(config.segmentation.kernels))
    for frame, truth in drive.sweeps():
        whole = segmenter.segment(frame.points)
        kept = _of_objects(frame.points, truth)
        kept[whole.members] = True
        points, row = frame.points[kept], np.cumsum(kept) - 1
        proposals = replace(whole, members=row[whole.members])
        likelihood = network.classify(points, proposals, np.arange(len(proposals)))
        yield SegmentedFrame(
            replace(frame, points=points), proposals, likelihood, truth, ObjectPoints.of(points, truth)
        )


def _of_objects(points: Float32, truth: FrameTruth) -> Bool:
    """(N,) points in or near the box of a labelled object."""
    kept, moved = np.zeros(len(points), np.bool_), in_box_frame(points, truth)
    for box in truth.box:
        kept |= inside(moved, box, pad_m=2 * PAD_M, foot_m=-2 * PAD_M)
    return kept


class PlayedBack:
    """Segmenter and classifier of a pipeline that gives the proposals of a segmented drive.

    Args:
        drive: segmented drive that is played back.
        range_m: range of interest; proposals beyond it are left out.
    """

    def __init__(self, drive: SegmentedDrive, range_m: float = np.inf) -> None:
        self._frames, self._range_m = iter(drive.frames), range_m
        self.classify, self.facts = drive.network.classify, drive.network.facts

    def segment(self, points: Float32) -> Proposals:
        """Proposals of the next frame."""
        proposals = next(self._frames).proposals
        return proposals.take(np.flatnonzero(within(proposals, self._range_m)))


def within(proposals: Proposals, range_m: float) -> Bool:
    """(P,) proposals within a range."""
    near: Bool = np.hypot(proposals.centroid[:, 0], proposals.centroid[:, 1]) <= range_m
    return near
