"""Replay of a simulated drive through the pipeline, with the truth of each frame."""

from __future__ import annotations

from argparse import ArgumentParser
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from modt.app import assembly
from modt.cli.options import frames as number_range
from modt.energy.ledger import NullLedger
from modt.geometry import FieldOfView
from modt.profile import load
from modt.types import NONE, Float64, FrameResult, Int, Proposals
from modt_desk.simulation.simulator import Truth
from modt_desk.simulation.synthetic_stream import SyntheticStream


@dataclass(frozen=True, slots=True)
class JudgedFrame:
    """Result and truth of a frame.

    Attributes:
        result: of the pipeline.
        truth: of the sweep.
        body: (P,) body with most points of each proposal, NONE for the ground.
        share: (P,) of its points on that body.
    """

    result: FrameResult
    truth: Truth
    body: Int
    share: Float64


def add_drives(parser: ArgumentParser) -> None:
    """Add the options that select simulated drives."""
    parser.add_argument("--scene", nargs="+", default=["street", "crossing"])
    parser.add_argument("--sensor", default="hdl-64e", help="sensor with a profile of the same name")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--seeds", type=number_range, default=(0, 4), metavar="A:B")
    parser.add_argument("--fov", choices=("camera", "full"), default="full")


def replay(stream: SyntheticStream, profile_name: str, *, camera: bool = False) -> Iterator[JudgedFrame]:
    """Run a stream in mode `efficient`, in the camera's view or over the full circle."""
    profile, mode = load(profile_name), assembly.MODES["efficient"]
    assert stream.info.camera is not None
    fov = FieldOfView.of_camera(stream.info.camera) if camera else FieldOfView()
    pipeline = assembly.pipeline(mode, profile, fov, NullLedger())
    for frame, truth in stream.sweeps():
        result = pipeline.step(frame, mode.budget(profile))
        yield JudgedFrame(result, truth, *majority_bodies(result.proposals, truth.instance))


def majority_bodies(proposals: Proposals, instance: Int) -> tuple[Int, Float64]:
    """(P,) body with most points of each proposal, NONE for the ground, and (P,) its share of the points."""
    n = len(proposals)
    if not n:
        return np.zeros(0, np.int64), np.zeros(0)
    bodies, number = np.unique(instance[proposals.members], return_inverse=True)
    of = np.repeat(np.arange(n), proposals.count)
    counts = np.bincount(of * len(bodies) + number, minlength=n * len(bodies)).reshape(n, len(bodies))
    best = counts.argmax(axis=1)
    body = np.where(bodies[best] < 0, NONE, bodies[best])
    return body, counts.max(axis=1) / proposals.count
