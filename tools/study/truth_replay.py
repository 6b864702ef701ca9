"""A synthetic drive through the pipeline, frame by frame beside its truth."""

from __future__ import annotations

from argparse import ArgumentParser
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from modt.tracking.background_map import BackgroundMap, NoBackgroundMap

from modt import assembly
from modt.cli.replay import frames as number_range
from modt.energy.ledger import NullLedger
from modt.geometry import FieldOfView
from modt.profile import load
from modt.simulation.simulator import Truth
from modt.sources.synthetic_stream import SyntheticStream
from modt.tracking.tracker import Tracker
from modt.types import NONE, FrameResult, Int, Proposals


@dataclass(frozen=True, slots=True)
class Seen:
    """A frame's result and what is true of it.

    Attributes:
        result: of the pipeline.
        truth: about the sweep.
        body: (P,) the body that most points of each proposal are of, NONE for the ground.
        share: (P,) of its points that are.
        tracker: after the frame.
    """

    result: FrameResult
    truth: Truth
    body: Int
    share: np.ndarray
    tracker: Tracker


def add_drives(parser: ArgumentParser) -> None:
    """Options that say which synthetic drives to study."""
    parser.add_argument("--scene", nargs="+", default=["street", "crossing"])
    parser.add_argument("--sensor", default="hdl-64e", help="there must be a profile of its name")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--seeds", type=number_range, default=(0, 4), metavar="A:B")
    parser.add_argument("--fov", choices=("camera", "full"), default="full")


def replay(
    stream: SyntheticStream,
    profile_name: str,
    *,
    mode_name: str = "efficient",
    camera: bool = False,
    background_map: NoBackgroundMap | BackgroundMap | None = None,
) -> Iterator[Seen]:
    """Every frame; the profile is that of the sensor, the memory the tracker's own where none is given."""
    profile, mode = load(profile_name), assembly.MODES[mode_name]
    assert stream.info.camera is not None
    fov = FieldOfView.of_camera(stream.info.camera) if camera else FieldOfView()
    pipeline = assembly.pipeline(mode, profile, fov, NullLedger())
    tracker = Tracker(profile.tracking, mode.machine, background_map=background_map)
    pipeline = replace(pipeline, tracker=tracker)
    for frame, truth in stream.sweeps():
        result = pipeline.step(frame, mode.budget(profile))
        yield Seen(result, truth, *majority_bodies(result.proposals, truth.instance), tracker)


def majority_bodies(proposals: Proposals, instance: Int) -> tuple[Int, np.ndarray]:
    """(P,) body that most points of each proposal are of, NONE for the ground, and (P,) their share."""
    n = len(proposals)
    if not n:
        return np.zeros(0, np.int64), np.zeros(0)
    bodies, number = np.unique(instance[proposals.members], return_inverse=True)
    of = np.repeat(np.arange(n), proposals.count)
    counts = np.bincount(of * len(bodies) + number, minlength=n * len(bodies)).reshape(n, len(bodies))
    best = counts.argmax(axis=1)
    body = np.where(bodies[best] < 0, NONE, bodies[best])
    return body, counts.max(axis=1) / proposals.count
