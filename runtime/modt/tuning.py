"""Every chosen value of the method, a part for each stage.

docs/tuning.md lists them, with the effect of each on accuracy, track length and CPU time.
"""

from __future__ import annotations

from dataclasses import dataclass

from modt.classification.tuning import ClassificationTuning
from modt.geometry.tuning import ShapeTuning
from modt.object_box.tuning import ObjectBoxTuning
from modt.odometry.tuning import OdometryTuning
from modt.segmentation.tuning import SegmentationTuning
from modt.tracking.tuning import TrackingTuning


@dataclass(frozen=True)
class MethodTuning:
    """Chosen values of all stages, and of the comparison of k-DOPs that they share."""

    shape: ShapeTuning = ShapeTuning()
    segmentation: SegmentationTuning = SegmentationTuning()
    odometry: OdometryTuning = OdometryTuning()
    tracking: TrackingTuning = TrackingTuning()
    classification: ClassificationTuning = ClassificationTuning()
    object_box: ObjectBoxTuning = ObjectBoxTuning()
