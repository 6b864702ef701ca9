"""Tuning of the odometry: registration, its landmarks, and when a sweep is registered twice."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class LandmarkTuning:
    """Mean k-DOPs of landmarks, which are stationary tracks."""

    established_frames: int = 3
    """Frames at rest from which the mean is the position of the landmark; before, it is the filter's prediction.
    Chosen on: judgement."""

    min_gain: float = 0.03
    """Least weight of a new view in the mean. Greater: landmarks follow a drift of the poses faster, and hold the
    poses less; 0.03 follows within about 33 frames.
    Chosen on: twelve simulated drives, by the error of the heading at their ends."""

    max_jump_m: float = 0.2
    """Distance of an end from its mean beyond which the mean of that end restarts, since another part of the object
    has come into view [m].
    Chosen on: twelve simulated drives, by the error of the heading at their ends."""


@dataclass(frozen=True)
class RegistrationTuning:
    """Fit of a pose to landmarks."""

    reach_m: float = 2.5
    """Greatest correction of a pose, and greatest error of the first prediction [m]. A larger correction is refused.
    Greater: faster starts are found, and wrong pairs are more likely.
    Chosen on: judgement."""

    gate_m: float = 0.8
    """Greatest error of a prediction once the motion is known [m]; landmarks farther away are no candidates. Less: a
    sudden turn is found by the wide search, which costs more.
    Chosen on: judgement."""

    max_turn_rad: float = 0.2
    """Greatest turn of a correction [rad]. A larger one is refused.
    Chosen on: judgement."""

    end_sigma_m: float = 0.02
    """Scale of the error of an end of a k-DOP at range 0 [m]. Greater: ends that came into view weigh more.
    Chosen on: simulated drives, by the errors of the ends of landmarks."""

    end_sigma_per_m: float = 0.0007
    """Growth of `end_sigma_m` per metre of range [m/m].
    Chosen on: simulated drives, by the errors of the ends of landmarks."""

    young_sigma_m: float = 0.07
    """Further error of a landmark without an established mean [m]. Greater: such landmarks weigh less in the fit.
    Chosen on: judgement."""

    inlier_m: float = 0.2
    """Distance to its landmark within which an observation agrees with a motion [m].
    Chosen on: judgement."""

    min_agreement: float = 0.3
    """Share of inliers among the pairs above which the motion is known, and the next search is a near one.
    Chosen on: judgement."""

    inlier_ratio: float = 0.75
    """Share of inliers among the pairs of the near search below which pairs are sought farther away. Greater: more
    wide searches, at more cost.
    Chosen on: judgement."""

    inlier_drop: float = 0.5
    """Share of the last fit's inliers below which pairs are sought farther away, since a few may agree by chance.
    Chosen on: judgement."""

    initial_turn_rad: float = 0.05
    """Step between the 17 turns that are tried while no motion is known [rad].
    Chosen on: judgement; six simulated robots that spin at 180 degrees/s from the first sweep on."""


@dataclass(frozen=True)
class PoseCheckTuning:
    """Given poses against the landmarks."""

    near_m: float = 0.2
    """Distance along x and y within which a landmark is seen where it is known to be [m]. Less: smaller errors of the
    poses are noticed.
    Chosen on: simulated streets."""

    min_landmarks: int = 5
    """Fewest landmarks that tell whether a pose is right.
    Chosen on: judgement."""

    agreeing_share: float = 0.35
    """Share of the landmarks that are where a right pose says.
    Chosen on: simulated streets and drives of KITTI."""

    convincing_share: float = 0.3
    """Share of the landmarks that registration has to bring back before a pose is doubted. Less: right poses are
    doubted over hills, where it brings up to 0.28 to places where nothing rests.
    Chosen on: simulated streets, with poses that run backwards at 6 m/s, and hills."""

    better: float = 1.5
    """Ratio of the landmarks that registration has to bring back to those that the pose leaves in place.
    Chosen on: judgement."""

    anchor_s: float = 1.0
    """Time after which tracks at rest are sought where they were [s]. Less: noticed earlier, but slower errors are
    not.
    Chosen on: reported within 5 s."""

    motion_m: float = 0.12
    """Difference of the motions in `anchor_s` and `agree_s` up to which pose and scene agree [m].
    Chosen on: simulated streets; what rests moves by 0.05 m at most by right poses."""

    motion_share: float = 0.03
    """Further difference as a share of the way.
    Chosen on: simulated streets."""

    alike_share: float = 0.4
    """Share of what rested that has to move as one body by wrong poses. Less: people who begin to walk, and hills
    that are driven over, make right poses doubted.
    Chosen on: simulated hills and docks with right poses, whose greatest is 0.25; yards, halls, warehouses, lobbies
    and crowds with wrong ones."""

    turn_share: float = 0.02
    """Further difference of the turns as a share of the turn, since gyroscopes and wheels have errors of scale. It
    moves what rests in proportion to its range.
    Chosen on: simulated turns on the spot at up to 2 rad/s, by poses whose turns are wrong by 1 %."""

    motion_rad: float = 0.03
    """Difference of the turns in `agree_s` up to which they agree [rad].
    Chosen on: simulated streets."""

    agree_s: float = 1.5
    """Time of agreement after which poses are believed [s].
    Chosen on: good again within 5 s."""


@dataclass(frozen=True)
class OdometryTuning:
    """Everything that is chosen in the odometry.

    A sweep is registered a second time if the first registration changes the motion, and so the deskewed positions,
    by too much.
    """

    landmarks: LandmarkTuning = LandmarkTuning()
    registration: RegistrationTuning = RegistrationTuning()
    pose_check: PoseCheckTuning = PoseCheckTuning()

    repeat_range_m: float = 20.0
    """Range at which the change of the deskewed positions is judged [m]. Greater: changes of the turn count more.
    Chosen on: judgement; with `repeat_tolerance_m` 1 m/s or 3 degrees/s at 10 Hz."""

    repeat_tolerance_m: float = 0.05
    """Change of a deskewed position at `repeat_range_m` beyond which a sweep is registered a second time [m]. Less:
    more second registrations, at more cost.
    Chosen on: judgement."""
