"""Chosen values of the boxes of whole objects: what each does to the result, its unit, and what it was chosen on.

The usual sizes of the classes stand in `modt.class_sizes`.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class HeadingTuning:
    """Heading of an object, from its motion and from the rectangle fitted to its points."""

    max_fit_points: int = 64
    """Points of a proposal by which its rectangle is fitted [points]. More costs time.

    Chosen on: 24 simulated drives of six sensors (seeds 700 and 701).
    """
    side_noise_m: float = 0.1
    """Distance within which a point lies on a side [m]. With more, short sides decide less.

    Chosen on: 24 simulated drives of six sensors (seeds 700 and 701).
    """
    initial_sigma_rad: float = 0.75
    """Uncertainty of the heading of a new object [rad]. With less, a wrong first fit lasts longer.

    Chosen on: judgement.
    """
    drift_sigma_rad: float = 0.02
    """Uncertainty that a frame adds to the heading [rad]. With less, turns are followed later.

    Chosen on: 24 simulated drives of six sensors (seeds 700 and 701).
    """
    fit_sigma_rad: float = 0.15
    """Uncertainty of a rectangle fitted to a long side [rad]. With less, the heading follows
    the fit more than the motion.

    Chosen on: 24 simulated drives of six sensors (seeds 700 and 701).
    """
    min_side_m: float = 0.4
    """Length of the longer visible side up to which a fit has `least_fit_weight` [m].

    Chosen on: judgement.
    """
    full_side_m: float = 2.6
    """Length beyond `min_side_m` from which a fit has its full weight [m]. With less, short sides count more.

    Chosen on: judgement.
    """
    least_fit_weight: float = 0.01
    """Weight of the fit of the shortest sides. With less, small parts never turn an object.

    Chosen on: judgement.
    """
    person_fit_weight: float = 0.5
    """Weight of the fit of a cyclist, over that of a car. With more, swinging legs turn cyclists.

    Chosen on: 24 simulated drives of six sensors (seeds 700 and 701).
    """
    pedestrian_fit_weight: float = 0.001
    """Weight of the fit of a pedestrian. With more, arms and legs turn pedestrians.

    Chosen on: 24 simulated drives of six sensors (seeds 700 and 701).
    """
    motion_sigma_rad: float = 0.05
    """Uncertainty of the direction of motion beside that of the velocity [rad]. With less, the fit counts less.

    Chosen on: 24 simulated drives of six sensors (seeds 700 and 701).
    """
    min_speed_mps: float = 0.5
    """Speed from which what may move is taken to move [m/s]. With less, still objects turn to the noise.

    Chosen on: 24 simulated drives of six sensors (seeds 700 and 701).
    """
    min_moved_m: float = 0.25
    """Displacement from which what may move is taken to move [m]. See `min_speed_mps`.

    Chosen on: 24 simulated drives of six sensors (seeds 700 and 701).
    """
    evidence_memory: float = 0.9
    """Weight of the evidence so far for the axis of the heading when a frame is added. With less, it forgets faster.

    Chosen on: 24 simulated drives of six sensors (seeds 700 and 701).
    """
    max_evidence: float = 6.0
    """Bound on that evidence, in natural logarithms of a likelihood ratio. With more, a wrong axis lasts longer.

    Chosen on: 24 simulated drives of six sensors (seeds 700 and 701).
    """
    moving_evidence: float = 4.0
    """Evidence for the axis along which an object moves. With more, it keeps its axis longer once it stands.

    Chosen on: judgement.
    """
    turning_evidence: float = 2.0
    """Evidence against the axis from which it turns by 90 degrees. With less, parked objects turn more often.

    Chosen on: 24 simulated drives of six sensors (seeds 700 and 701).
    """
    whole_side_evidence: float = 0.5
    """Evidence of a side as long as usual, over that of a shorter one, which may be a part of any side.

    Chosen on: 24 simulated drives of six sensors (seeds 700 and 701).
    """
    axis_spread_m: float = 0.1
    """Deviation of a seen side from the true one [m], in the choice of the axis.

    Chosen on: 24 simulated drives of six sensors (seeds 700 and 701).
    """
    max_frame_evidence: float = 3.0
    """Bound on the evidence of a frame. With more, a single frame decides.

    Chosen on: judgement.
    """
    neighbour_m: float = 30.0
    """Distance along the axis of a car up to which another one has the same axis [m]. With more, more cars are turned
    as others stand.

    Chosen on: 24 simulated drives of six sensors (seeds 1402 and 1403), and the labels of KITTI's objects.
    """
    beside_m: float = 3.0
    """Distance across the axis of a car up to which another one has the same axis [m]. With more, cars in the next
    row are turned as this one.

    Chosen on: the labels of KITTI's objects, and a posed car park whose rows stand across each other.
    """
    neighbour_evidence: float = 1.0
    """Evidence that a car has the axis of its neighbour. With more, cars that stand otherwise are turned.

    Chosen on: 24 simulated drives of six sensors (seeds 1402 and 1403).
    """
    shoulder_ratio: float = 1.2
    """Ratio of the seen sides of a pedestrian from which the longer one counts as the line of the shoulders.

    Chosen on: judgement.
    """
    across_evidence: float = 0.5
    """Evidence that a pedestrian who stands looks across the longer seen side, the line of the shoulders.

    Chosen on: 24 simulated drives of six sensors (seeds 700 and 701).
    """


@dataclass(frozen=True)
class SizeTuning:
    """Size of an object, from its class and all that was seen of it."""

    growth: float = 0.2
    """Share by which the known size follows a larger seen one in a frame. With more, merged objects count more.

    Chosen on: 24 simulated drives of six sensors (seeds 700 and 701).
    """
    shrinkage: float = 0.08
    """Share by which the known size follows a smaller seen one in a frame. With more, hidden objects shrink.

    Chosen on: 24 simulated drives of six sensors (seeds 700 and 701).
    """
    doubt: float = 0.6
    """Odds that a side which looks as long as usual is not seen whole. With more, objects have their usual sizes.

    Chosen on: 24 simulated drives of six sensors (seeds 700 and 701).
    """
    length_noise_m: float = 0.1
    """Deviation of the seen from the true length [m]. With more, objects have their usual lengths.

    Chosen on: 24 simulated drives of six sensors (seeds 700 and 701).
    """
    width_noise_m: float = 0.3
    """Deviation of the seen from the true width, as mirrors are not part of it [m]. With more, objects have their
    usual widths.

    Chosen on: 24 simulated drives of six sensors (seeds 700 and 701).
    """
    height_noise_m: float = 0.1
    """Deviation of the seen from the true height [m]. With more, objects have their usual heights.

    Chosen on: 24 simulated drives of six sensors (seeds 700 and 701).
    """
    stride_m: float = 0.35
    """Length that the stride of a moving pedestrian adds to the usual one [m].

    Chosen on: 24 simulated drives of six sensors (seeds 700 and 701).
    """


@dataclass(frozen=True)
class CentreTuning:
    """Centre of an object about the visible part."""

    gain: float = 0.35
    """Share by which the centre follows the visible part in a frame. With more, it follows noise and occlusion.

    Chosen on: 24 simulated drives of six sensors (seeds 700 and 701).
    """
    pedestrian_depth_m: float = 0.115
    """Distance from the centroid of a pedestrian's points to the axis of the body, away from the sensor [m].

    Chosen on: 24 simulated drives of six sensors (seeds 700 and 701).
    """
    cyclist_depth_m: float = 0.24
    """Distance from the centroid of a cyclist's points to the centre, away from the sensor [m].

    Chosen on: 24 simulated drives of six sensors (seeds 700 and 701).
    """
    slack_m: float = 0.05
    """Distance by which a visible part may stand out of the box [m]. With more, the centre is smoother and later.

    Chosen on: judgement.
    """
    min_reach_m: float = 0.3
    """Least distance from the sensor to the middle of the visible part, along an axis, from which the near end is
    certain [m].

    Chosen on: judgement.
    """


@dataclass(frozen=True)
class ObjectBoxTuning:
    """All chosen values of the stage, one part a mechanism."""

    heading: HeadingTuning = HeadingTuning()
    size: SizeTuning = SizeTuning()
    centre: CentreTuning = CentreTuning()
