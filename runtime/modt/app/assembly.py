"""The modes of the method, and the one place where the stages of a pipeline are put together."""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from modt import host
from modt.classification.call_cost import LinearCost, padded_size, warm_up
from modt.classification.decision import Decision, LikeliestClass
from modt.classification.fusion import EveryFrame, FirstViews, FurtherViews
from modt.classification.pointnet import PointNet
from modt.classification.prior import Prior, make_prior
from modt.classification.product_fusion import AnyView, KeyViews
from modt.classification.scheduler import Scheduler
from modt.classification.tuning import ClassificationTuning, FusionTuning
from modt.config import (
    KERNELS,
    NATIVE,
    ClassificationConfig,
    FusionConfig,
    MountedSensor,
    ProfileConfig,
    ReadSensor,
    SensorConfig,
)
from modt.config import NUMPY as NUMPY_NAME
from modt.energy.ledger import Ledger
from modt.errors import MisuseError
from modt.geometry import FieldOfView
from modt.geometry.field_of_view import BlindSectors
from modt.geometry.kernels import GeometryKernels
from modt.geometry.tuning import ShapeTuning
from modt.model_file import ModelFile
from modt.native.library import NotAvailableError, load
from modt.object_box.estimator import SeenBoxes
from modt.object_box.native_estimator import whole_boxes_of
from modt.odometry.pose_estimator import PoseEstimator
from modt.pipeline import ClassificationStage, FusionStage, Pipeline, SegmentationStage, SensorView, ViewStage
from modt.placement import Mount
from modt.profile import load as load_profile
from modt.segmentation.kernels import Kernels
from modt.segmentation.native_kernels import NativeKernels
from modt.segmentation.segmenter import Segmenter
from modt.segmentation.tuning import SegmentationTuning
from modt.sensor_fit.levelling import Leveller
from modt.tracking.states import ACCURATE, CONVENTIONAL, EFFICIENT, StateMachine
from modt.tracking.track_table import LiveTracks
from modt.tracking.tracker import Tracker
from modt.tuning import MethodTuning
from modt.types import UNLIMITED, Budget, Float32, Proposals

log = logging.getLogger(__name__)


MakeFusion = Callable[[FusionConfig, Prior, FusionTuning], FusionStage]


@dataclass(frozen=True)
class Mode:
    """One way of the method over the same stages.

    Attributes:
        machine: states of a track and their transitions.
        fusion: choice of the views to classify, and their combination.
        budget: budget of a frame.
    """

    machine: StateMachine
    fusion: MakeFusion
    budget: Callable[[ProfileConfig], Budget]


def _profile_budget(profile: ProfileConfig) -> Budget:
    return Budget(profile.scheduler.calls_per_frame, mean_ms=profile.classification_ms)


def _by_rule(mean: MakeFusion, product: Callable[[FusionConfig, Prior], FusionStage]) -> MakeFusion:
    """The fusion of the rule that the profile names; the product has nothing that was chosen."""

    def fusion(config: FusionConfig, prior: Prior, tuning: FusionTuning) -> FusionStage:
        return product(config, prior) if config.rule == "product" else mean(config, prior, tuning)

    return fusion


MODES = {
    "conventional": Mode(CONVENTIONAL, lambda config, prior, tuning: EveryFrame(), lambda profile: UNLIMITED),
    "efficient": Mode(EFFICIENT, _by_rule(FirstViews, AnyView), _profile_budget),
    "accurate": Mode(ACCURATE, _by_rule(FurtherViews, KeyViews), _profile_budget),
}
"""Fig. 2a, and the sections on efficient (Table I) and accurate detection (Table II)."""


@dataclass(frozen=True)
class BlindSectorFilter:
    """Moves the points of blind sectors to the origin, which means no return, before it segments."""

    segmenter: SegmentationStage
    sectors: BlindSectors

    def facts(self) -> dict[str, str]:
        """Kernels of the segmenter."""
        return self.segmenter.facts()

    def leave_out(self, dead_deg: tuple[float, ...]) -> None:
        """Take the beams of these elevations for dead, and all others for alive."""
        self.segmenter.leave_out(dead_deg)

    def segment(self, points: Float32) -> Proposals:
        """Proposals of (N, 4) points."""
        kept = points.copy()
        kept[self.sectors.contain(points), :3] = 0.0
        return self.segmenter.segment(kept)


VARIABLE = "MODT_KERNELS"


def chosen_kernels(wanted: str, tuning: ShapeTuning = ShapeTuning()) -> Kernels:
    """The kernels of a name in KERNELS, or of the name in the environment variable MODT_KERNELS.

    Raises:
        MisuseError: the name is unknown, or the compiled ones are asked for and cannot be used.
    """
    name = os.environ.get(VARIABLE) or wanted
    if name not in KERNELS:
        raise MisuseError(VARIABLE, f"no kernels {name!r}", f"use one of: {', '.join(KERNELS)}")
    if name == NUMPY_NAME:
        return Kernels(tuning)
    try:
        return NativeKernels(*load(), tuning)
    except NotAvailableError as error:
        if name == NATIVE:
            raise MisuseError("segmentation.kernels", f"native: {error}", f"or use {NUMPY_NAME}") from None
        log.warning("the passes over points run on NumPy: a frame takes about half as long again: %s", error)
        return Kernels(tuning)


def segmenter(
    profile: ProfileConfig, fov: FieldOfView, kernels: Kernels, tuning: SegmentationTuning = SegmentationTuning()
) -> SegmentationStage:
    """The first stage, the same in every mode."""
    sensor = profile.sensor
    stage = Segmenter(profile.segmentation, sensor, fov, kernels, tuning)
    if sensor.blind_sectors_deg is None:
        return stage
    return BlindSectorFilter(stage, BlindSectors(sensor.blind_sectors_deg, sensor.blind_range_m))


def leveller(sensor: SensorConfig) -> Leveller:
    """Levelling of the sweeps of a mounted sensor."""
    return Leveller(Mount.of(sensor.roll_deg, sensor.pitch_deg), sensor.height_m, sensor.min_range_m)


def view(
    profile: ProfileConfig, fov: FieldOfView, kernels: Kernels, tuning: SegmentationTuning = SegmentationTuning()
) -> ViewStage:
    """The view of the sensor of a profile, or of all its sensors together.

    Raises:
        MisuseError: the profile of one of several sensors cannot be used.
    """
    if not profile.sensors:
        return SensorView(leveller(profile.sensor), segmenter(profile, fov, kernels, tuning))
    from modt.joint_view import JointView, SensorPart

    parts = []
    for mounted in profile.sensors:
        config = sensor_profile(mounted)
        stage = segmenter(config, FieldOfView(), kernels, tuning)
        parts.append(SensorPart(mounted, config.sensor, leveller(config.sensor), stage))
    return JointView(parts, kernels, tuning.joining)


def sensor_profile(mounted: MountedSensor) -> ProfileConfig:
    """The profile of one of several sensors with its mount, as it was read, or from disk if it was not.

    Raises:
        MisuseError: there is no such profile, or it cannot be used.
    """
    config = mounted.read if isinstance(mounted, ReadSensor) else load_profile(mounted.profile)
    return replace(config, sensor=mounted.mounted(config.sensor))


def network(
    config: ClassificationConfig, sensor: SensorConfig, tuning: ClassificationTuning = ClassificationTuning()
) -> PointNet:
    """The classifier with the model that the configuration names.

    Raises:
        MisuseError: the model cannot be used.
    """
    return PointNet(ModelFile.find(config.model), config, sensor, tuning)


def _check_budget(budget: Budget, cost: LinearCost, profile: ProfileConfig) -> None:
    """Warn of a budget that is below the price of one classification."""
    price_ms = cost.cost_ms(np.ones(1, np.int64))
    if budget.mean_ms is None or price_ms <= budget.mean_ms:
        return
    price = f"{budget.mean_ms:.2g} ms of CPU a frame, but a classification takes {price_ms:.2g} ms on this machine"
    often = f"one is made every {price_ms / budget.mean_ms:.3g} frames" if budget.mean_ms else "none is made"
    remedy = f"cpu_ms_per_frame to {price_ms:.2g} or energy_mJ_per_frame to {price_ms * profile.energy.active_W:.2g}"
    log.warning("scheduler: the budget is %s: %s; for one in each raise %s", price, often, remedy)


@dataclass(slots=True)
class Continuity:
    """Tracks and world that go on when the stages of a run are exchanged for those of another profile."""

    tracks: LiveTracks = field(default_factory=LiveTracks)
    odometry: PoseEstimator | None = None  # the last one, whose world the next one continues


def pipeline(
    mode: Mode,
    profile: ProfileConfig,
    fov: FieldOfView,
    ledger: Ledger | None = None,
    continuity: Continuity | None = None,
    tuning: MethodTuning = MethodTuning(),
    substitute: Callable[[PointNet], ClassificationStage] = lambda network: network,
) -> Pipeline:
    """The stages of a mode. Without a ledger they have one of their own; without a continuity they begin anew.

    `substitute` gives the classifier that is used in place of the network.

    Raises:
        MisuseError: the model cannot be used.
    """
    host.keep_freed_pages()
    kernels = chosen_kernels(profile.segmentation.kernels, tuning.shape)
    limits = profile.classification
    model = network(limits, profile.sensor, tuning.classification)
    classifier = substitute(model)
    cost = LinearCost(
        limits.max_points, padded_size(limits, tuning.classification.batching), tuning.classification.call_cost
    )
    warm_up(classifier.classify, cost, limits.max_points, limits.batch, time.thread_time_ns)
    _check_budget(mode.budget(profile), cost, profile)
    return stages(
        mode,
        profile,
        model,
        view(profile, fov, kernels, tuning.segmentation),
        classifier,
        cost,
        ledger or Ledger(),
        kernels,
        continuity,
        tuning,
    )


def stages(
    mode: Mode,
    profile: ProfileConfig,
    network: PointNet,
    view: ViewStage,
    classifier: ClassificationStage,
    cost: LinearCost,
    ledger: Ledger,
    kernels: GeometryKernels,
    continuity: Continuity | None = None,
    tuning: MethodTuning = MethodTuning(),
) -> Pipeline:
    """A pipeline around a given view, and the network or a substitute of the given cost as its classifier."""
    prior = make_prior(network.box_scores, network.class_frequency)
    continuity = continuity or Continuity()
    odometry = PoseEstimator(kernels, tuning.odometry)
    if continuity.odometry is not None:
        odometry.adopt(continuity.odometry)
    continuity.odometry = odometry
    chosen = tuning.classification
    if profile.decision.rule == "likeliest":
        decision = LikeliestClass(profile.decision, network.class_frequency)
    else:
        decision = Decision(profile.decision, network.class_frequency, chosen.decision)
    boxes = whole_boxes_of(kernels, tuning.object_box) if profile.tracking.extensions == "all" else SeenBoxes()
    return Pipeline(
        view=view,
        odometry=odometry,
        tracker=Tracker(
            profile.tracking,
            mode.machine,
            period_s=profile.sensor.period_s,
            kernels=kernels,
            live=continuity.tracks,
            tuning=tuning.tracking,
        ),
        fusion=mode.fusion(profile.fusion, prior, chosen.fusion),
        scheduler=Scheduler(cost, profile.sensor.period_s, chosen.worth),
        classifier=classifier,
        decision=decision,
        boxes=boxes,
        ledger=ledger,
    )
