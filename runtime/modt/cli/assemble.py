"""Where the parts are put together."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from modt.classification.fusion import EveryFrame, FirstView, KeyViews
from modt.classification.instrumentation import CostedClassifier
from modt.classification.pointnet import PointNet
from modt.classification.prior import Prior, prior_of
from modt.classification.scheduler import LinearCost, Scheduler
from modt.config import FusionConfig, OdometryConfig, ProfileConfig
from modt.energy.instrumentation import CountedClassifier
from modt.energy.ledger import StageLedger
from modt.errors import MisuseError
from modt.geometry import FieldOfView
from modt.odometry.odometry import Odometry
from modt.pipeline import Fusion, Pipeline
from modt.profile import DEFAULT
from modt.segmentation.segmenter import Segmenter
from modt.sources.pose_socket import PoseSocket, open_socket
from modt.sources.pose_source import ListedPoses, NoOdometry, OwnOdometry
from modt.sources.pose_source import Odometry as PoseSource
from modt.sources.recognise import open_stream
from modt.sources.stream import Stream
from modt.sources.synthetic_stream import SyntheticStream
from modt.tracking.states import ACCURATE, CONVENTIONAL, EFFICIENT, StateMachine
from modt.tracking.tracker import Tracker
from modt.types import UNLIMITED, Budget

EMBEDDED_SECONDS = 10.0
OWN, NONE = "own", "none"
"""Odometries that need no address."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """What a user asks for; each field is an option of `modt replay`."""

    path: Path | None = None
    mode: str = "accurate"
    profile: str = DEFAULT
    fov: str = "full"
    frames: tuple[int, int | None] = (0, None)
    rate_hz: float | None = None
    labels: bool = False
    odometry: str = OWN
    poses: Path | None = None


@dataclass(frozen=True, slots=True)
class Mode:
    """One way of the method over the same stages.

    Attributes:
        machine: the states that a track goes through.
        fusion: which views are classified and what becomes of them.
        budget: what a frame may spend.
    """

    machine: StateMachine
    fusion: Callable[[FusionConfig, Prior], Fusion]
    budget: Callable[[ProfileConfig], Budget]


def _profile_budget(profile: ProfileConfig) -> Budget:
    return Budget(profile.scheduler.calls_per_frame, profile.classification_ms)


MODES = {
    "conventional": Mode(CONVENTIONAL, lambda config, prior: EveryFrame(), lambda profile: UNLIMITED),
    "efficient": Mode(EFFICIENT, FirstView, _profile_budget),
    "accurate": Mode(ACCURATE, KeyViews, _profile_budget),
}
"""Fig. 2a, and the sections on efficient (Table I) and accurate detection (Table II)."""


def stream(request: Request) -> Stream:
    """The stream asked for, the embedded one where no path is given.

    Raises:
        MisuseError: the path is no stream.
    """
    if request.path is None:
        whole: Stream = SyntheticStream("street", "hdl-64e", EMBEDDED_SECONDS, seed=0)
    else:
        whole = open_stream(request.path)
    cut = whole.between(*request.frames)
    if cut.info.n_frames == 0:
        first, last = request.frames
        asked = f"{first}:{'' if last is None else last}"
        raise MisuseError(whole.info.name, f"no frames in {asked}", f"it holds {whole.info.n_frames} frames")
    return cut


def odometry(request: Request, stream: Stream, config: OdometryConfig) -> PoseSource:
    """Where the poses of a stream's frames come from.

    Raises:
        MisuseError: a file of poses that cannot be used, an address that cannot be bound or is none.
    """
    if request.poses is not None:
        return ListedPoses(request.poses, stream.info.camera, stream.info.end)
    if request.odometry == OWN:
        return OwnOdometry()
    if request.odometry == NONE:
        return NoOdometry()
    return PoseSocket(open_socket(request.odometry), config, request.odometry)


def field_of_view(request: Request, stream: Stream) -> FieldOfView:
    """The part of space to look at.

    Raises:
        MisuseError: the camera's is asked for and the stream has none.
    """
    if request.fov == "full":
        return FieldOfView()
    if stream.info.camera is None:
        missing = next((n for n in stream.info.notes if "camera" in n), "it has no calibration")
        raise MisuseError(stream.info.name, missing, "restore the calibration, or use --fov full")
    return FieldOfView.of_camera(stream.info.camera)


def pipeline(mode: Mode, profile: ProfileConfig, fov: FieldOfView, ledger: StageLedger) -> Pipeline:
    """The stages of a mode.

    Raises:
        MisuseError: the model cannot be used.
    """
    cost = LinearCost(profile.classification.max_points)
    limits = profile.classification
    network = PointNet(limits, profile.sensor)
    prior = prior_of(network.boxes, profile.fusion.prior, profile.sensor, network.evidence)
    classifier = CostedClassifier(network, cost, time.thread_time_ns)
    return Pipeline(
        segmenter=Segmenter(profile.segmentation, profile.sensor, fov),
        odometry=Odometry(profile.odometry),
        tracker=Tracker(profile.tracking, mode.machine),
        fusion=mode.fusion(profile.fusion, prior),
        scheduler=Scheduler(cost),
        classifier=CountedClassifier(classifier, ledger, limits.max_points, limits.batch),
        ledger=ledger,
    )
