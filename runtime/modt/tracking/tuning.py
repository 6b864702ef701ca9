"""Tuning of the tracking stage: every value of it that was chosen, by mechanism."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class FilterTuning:
    """Noise of the extended Kalman filter (Equation 1), which profiles without extensions use."""

    acceleration_sigma_mps2: float = 2.0
    """Process noise of the speed [m/s2]. Greater: speed follows the last positions faster, and jitters more.
    Chosen on: judgement."""

    turn_sigma_radps: float = 0.3
    """Process noise of the heading [rad/s]. Greater: turns are followed faster, and straight courses waver.
    Chosen on: judgement."""

    initial_position_sigma_m: float = 0.3
    """Standard deviation of the position of a new track, along either axis [m]. Greater: the second position counts
    more than the first.
    Chosen on: judgement."""

    initial_speed_sigma_mps: float = 8.0
    """Standard deviation of the speed of a new track [m/s]. Less: fast objects are lost in their second frame.
    Chosen on: judgement."""


@dataclass(frozen=True)
class MotionFilterTuning:
    """Filter of two hypotheses, at rest and moving."""

    acceleration_sigma_mps2: float = 0.7
    """Process noise of the velocity of what moves [m/s2]. Greater: velocities follow the last positions faster, and
    jitter more.
    Chosen on: simulated streets with vehicles that accelerate, by the error of velocities."""

    relative_acceleration_sigma_per_s: float = 0.8
    """Further process noise of the speed, relative to the speed [1/s]. Greater: fast objects that brake or
    accelerate are followed sooner, and their speeds jitter more.
    Chosen on: simulated streets with vehicles that accelerate, by the error of velocities."""

    turn_sigma_radps: float = 0.3
    """Further process noise of the velocity across its direction, relative to the speed [rad/s]. Greater: fast
    objects are followed through sharper turns, and their directions jitter more.
    Chosen on: simulated streets with vehicles that accelerate, by the error of velocities."""

    start_sigma_mps: float = 1.0
    """Standard deviation of the velocity of what has just started, along either axis [m/s]. Greater: slow starts are
    seen later.
    Chosen on: judgement."""

    starts_per_s: float = 0.1
    """Rate at which tracks at rest start [1/s]. Greater: starts are seen earlier, and more things seem to move.
    Chosen on: simulated scenes, by static things that were reported as moving."""

    stops_per_s: float = 0.1
    """Rate at which moving tracks stop [1/s]. Greater: stops are seen earlier, and slow objects seem to stand.
    Chosen on: simulated scenes, by the error of velocities."""

    initially_moving: float = 0.8
    """Probability that a new track moves. Greater: movers are seen earlier, and more things seem to move.
    Chosen on: simulated scenes, by the delay of movers."""

    initial_position_sigma_m: float = 0.05
    """Standard deviation of the position of a new track, along either axis [m]. Greater: the second position counts
    more than the first.
    Chosen on: simulated streets, by the error of velocities of new tracks."""

    initial_speed_sigma_mps: float = 5.0
    """Standard deviation of the velocity of a new moving track, along either axis [m/s]. Less: fast objects are lost
    in their second frame.
    Chosen on: judgement."""

    max_person_penalty: float = 1.0
    """Most that the uncertainty of its velocity takes from the logarithm of the odds that a person moves. Greater:
    new walkers seem to stand.
    Chosen on: simulated streets with cyclists that accelerate, by the error of velocities of new tracks."""

    creep_mps: float = 0.02
    """Process noise of a resting position [m/sqrt(s)]. Greater: slow motion is taken for rest.
    Chosen on: judgement."""

    max_distance: float = 9.2
    """Squared distance of a position from where a moving track was expected, in standard deviations, beyond which it
    is no evidence of motion: 99 % of those of movers are nearer. Greater: what flickers moves.
    Chosen on: judgement."""

    max_log_ratio: float = 3.0
    """Most that one frame adds to the logarithm of the odds of moving, or takes from it. Greater: one jump of a
    proposal makes a mover.
    Chosen on: judgement."""


@dataclass(frozen=True)
class MotionEvidenceTuning:
    """Weight of motion that a changing view explains."""

    min_height_m: float = 0.2
    """A flat proposal lower than this is no evidence of motion, since where beams meet the ground moves with the
    robot [m]. Greater: small movers are missed.
    Chosen on: simulated streets, by low things that were reported as moving."""

    flat_height: float = 0.4
    """Height of a proposal, relative to its length, below which it is flat. Greater: balls do not move.
    Chosen on: simulated balls and streets."""

    one_side_weight: float = 0.1
    """Weight of evidence from a proposal that is bounded on one side by what is nearer or goes on there; from one
    bounded on both sides it is 0. Less: fewer parts of walls seem to move, and movers beside others are seen later.
    Chosen on: simulated streets, by parts of walls that were reported as moving."""

    compact_one_side_weight: float = 0.5
    """Weight of evidence from a compact proposal that is bounded on one side, since it is rarely a part of a surface.
    Less: people who walk among other things are seen later.
    Chosen on: simulated streets and aisles, by static things that were reported as moving."""

    compact_two_sides_weight: float = 0.15
    """Weight of evidence from a compact proposal that is bounded on both sides.
    Chosen on: simulated streets and aisles, by static things that were reported as moving."""

    object_weight: float = 0.5
    """Weight of evidence from the proposal of a track whose class is neither background nor that of a walker, bounded
    on one side or both.
    Chosen on: simulated streets, by the error of velocities."""

    max_compact_m: float = 1.2
    """Greatest length of a compact proposal [m]. Greater: parts of shelves seem to move.
    Chosen on: simulated aisles, by static things that were reported as moving."""

    min_compact_width: float = 0.4
    """Least width of a compact proposal, relative to its length. Less: parts of walls seem to move.
    Chosen on: simulated aisles, by static things that were reported as moving."""

    moving: float = 0.97
    """A track moves from this probability on. Greater: fewer static things move, and starts are reported later.
    Chosen on: simulated scenes, by static things that were reported as moving."""

    min_distance_m: float = 0.2
    """Distance from its rest position from which a track moves [m]. Greater: what sways does not move, and slow
    starts are reported later.
    Chosen on: judgement."""

    velocity_variance: float = 0.2
    """Variance of the velocity that is published once the motion of a track is known, relative to that of the filter,
    which allows for accelerations and jumps that are rare. Greater: velocities seem less certain.
    Chosen on: simulated streets with vehicles that accelerate, by the errors of velocities of cars and cyclists."""

    min_hits: int = 5
    """Frames with a proposal from which the motion of a track is known. Less: movers are reported earlier, and what
    flickers moves.
    Chosen on: simulated snow and streets."""


@dataclass(frozen=True)
class SightTuning:
    """Lines of sight beside proposals."""

    rays: int = 8000
    """Number of points of a sweep that are looked at, in turns. Greater: thin things that hide others are found, and
    it takes longer.
    Chosen on: judgement."""

    margin_m: float = 0.3
    """A proposal is bounded where what is beside it is less than this behind its end, and a person is hidden by what
    is nearer by more than this [m]. Greater: ends near walls are bounded, and people close behind things are not
    hidden.
    Chosen on: simulated scenes, by static things that were reported as moving."""


@dataclass(frozen=True)
class KdopAssociationTuning:
    """Association of k-DOPs, and the measurement of positions by them."""

    max_cost: float = 7.0
    """Cost of leaving a track without a proposal; no matched pair costs more. Greater: more tracks are matched, some
    with a neighbour.
    Chosen on: judgement."""

    min_overlap: float = 0.3
    """Least overlap, relative to the smaller, of a pair that changed its shape and is matched second. Less: a track
    is matched with what lies beside its object.
    Chosen on: judgement."""

    jump_sigma_m: float = 0.4
    """Standard deviation of an end of a k-DOP as parts of an object come into view [m]. Greater: pairs further apart
    are matched.
    Chosen on: judgement."""

    reach_margin_m: float = 0.5
    """Margin around a track within which proposals are candidates for it, beside the uncertainty of its position [m].
    Less: fewer pairs are compared, and a track whose shape changes is lost.
    Chosen on: judgement."""

    reach_sigmas: float = 3.0
    """Most standard deviations of its position, beyond the margin, at which a proposal is a candidate for a track.
    Less: fewer pairs are compared, and a track that turns is lost.
    Chosen on: judgement."""

    position_sigma_m: float = 0.05
    """Standard deviation of a measured position along either axis [m]. Greater: the filter smooths more.
    Chosen on: simulated streets, by the error of velocities."""

    size_weight: float = 2.0
    """Cost of a difference of 1 of the logarithms of the widths. Greater: pairs of other sizes are matched less
    often.
    Chosen on: judgement."""

    overlap_weight: float = 3.0
    """Cost of no overlap; one of half of the union costs half. Greater: pairs side by side are matched less often.
    Chosen on: judgement."""

    height_weight_per_m: float = 2.0
    """Cost of a mean difference of bottom and top of a metre [1/m]. Greater: pairs of other heights are matched less
    often.
    Chosen on: judgement."""

    points_weight: float = 0.5
    """Cost of a difference of 1 of the logarithms of the numbers of points. Greater: pairs of other numbers are
    matched less often.
    Chosen on: judgement."""


@dataclass(frozen=True)
class PaperAssociationTuning:
    """Association of profile `paper` (section III-B)."""

    alpha: float = 2.0
    """Weight of 1 - I, the lacking overlap, in the cost of a match. Chosen on: the paper."""

    beta: float = 0.01
    """Weight of the likeness of point numbers. Chosen on: the paper."""

    gamma: float = 0.1
    """Weight of the likeness of sizes. Chosen on: the paper."""

    max_cost: float = 0.95
    """Greatest cost of a match, T_DA. Chosen on: the paper."""

    position_sigma_m: float = 0.3
    """Standard deviation of a centroid [m], which the paper does not state. Greater: tracks turn later.
    Chosen on: drive 0005, by the nearness to Table VI."""


@dataclass(frozen=True)
class ExtentTuning:
    """Memory of the extent, the shape and the size of a track, and of the place that it comes from."""

    lag_s: float = 1.5
    """Time constant of the place that a displacement is measured from [s]. Greater: slow motion shows better, and a
    stop shows later.
    Chosen on: judgement."""

    known_decay: float = 0.98
    """Share of the known extent beyond the visible one that is left after a frame with a proposal. Less: parts
    that come back into view are not joined.
    Chosen on: judgement."""

    mean_decay: float = 0.8
    """Greatest weight of the past in a mean k-DOP. Greater: positions jitter less, and follow a changing shape later.
    Chosen on: judgement."""

    growth: float = 0.5
    """Weight of a larger box in the size of a track. Greater: one frame merged with a neighbour makes it large.
    Chosen on: judgement."""

    person_growth: float = 0.1
    """`growth` of a confirmed person, who is merged with things in passing. Greater: cyclists beside walls lose their
    class.
    Chosen on: pandar64 drives with cyclists beside walls."""

    shrinkage: float = 0.02
    """Weight of a smaller box in the size of a track: the part that is hidden now was seen before. Greater: parts of
    a hidden car count as people.
    Chosen on: judgement."""


@dataclass(frozen=True)
class RestTuning:
    """Test whether a track is at rest."""

    radius_m: float = 0.5
    """A track this near to its rest position is at rest [m]. Greater: slow walkers are kept in place.
    Chosen on: judgement."""

    stopped_mps: float = 0.5
    """A moving track slower than this rests where it is [m/s]. Greater: walkers come to rest now and then.
    Chosen on: judgement."""

    gain: float = 0.1
    """Weight of a new position in the rest position. Greater: the rest position creeps along with slow objects.
    Chosen on: judgement."""

    min_hits: int = 3
    """Frames with a proposal from which a track can be at rest; a younger one may be a landmark of the odometry.
    Greater: new landmarks are used later.
    Chosen on: judgement."""

    max_missed: int = 2
    """Frames without a proposal up to which a track is a landmark of the odometry. Greater: landmarks that are gone
    are searched longer.
    Chosen on: judgement."""


@dataclass(frozen=True)
class HidingTuning:
    """People in hiding."""

    side_sigma_m: float = 0.3
    """Standard deviation that a bounded side adds to the position of a person, along either axis [m]. Less: who goes
    into hiding seems to slow down. Greater: who walks beside others is followed less closely.
    Chosen on: simulated people who walk behind pillars, cars and lorries, and who meet."""

    max_sigma_m: float = 1.8
    """Standard deviation of the position of a person in hiding up to which the track is kept, a person's height [m].
    Greater: tracks are kept longer, and more of them end with someone else.
    Chosen on: judgement."""

    reach_m: float = 1.5
    """Distance from the way between the last place and the expected one within which a new person is the one who was
    lost [m]. Less: who turns or goes faster in hiding is a new track. Greater: others are taken for the lost.
    Chosen on: simulated people who walk behind pillars, cars and lorries."""

    max_age: int = 8
    """Greatest age of a track that may be the continuation of a lost one [frames]. Less: people who are recognised
    late stay new tracks.
    Chosen on: judgement."""


@dataclass(frozen=True)
class RegroupingTuning:
    """Limits of regrouping."""

    min_coverage: float = 0.45
    """Least part of a proposal within the known extent of a track, or of the expected track within a proposal. Less:
    neighbours are taken for parts.
    Chosen on: judgement."""

    min_part_coverage: float = 0.7
    """Least part of a proposal within the known extent of the track that it is joined with. Less: neighbours are
    joined.
    Chosen on: judgement."""

    max_excess_m: float = 0.3
    """A known part is joined only if the joined object exceeds the known extent by less than this; a proposal that
    exceeds the expected extent by more may be split [m]. New parts beside an object are limited by WHOLE_SIZE_M
    instead. Greater: more is joined and less is split.
    Chosen on: judgement."""

    beside_m: float = 0.6
    """Greatest gap between a car or a cyclist and a new proposal that is joined with it [m]. Greater: more parts are
    joined, and more neighbours.
    Chosen on: judgement."""

    margin_m: float = 0.2
    """Margin around the expected extent, and above the expected top, within which points are split off [m]. Greater:
    pieces hold more of what their object touches.
    Chosen on: judgement."""

    touch_m: float = 0.05
    """A piece that reaches this near to the margin goes on beyond it, so its end there is not known [m]. Greater:
    fewer ends of pieces measure a position.
    Chosen on: judgement."""

    taller_m: float = 0.08
    """Height above a car from which a possible person within its known extent is no part of it [m]. Less: cars fall
    apart. Greater: who stands in an open door becomes a part of the car.
    Chosen on: people at the doors of simulated cars, with a check on simulated streets."""

    min_person_points: int = 20
    """Points from which a possible person beside a car is no part of it. Less: cars of which little is seen fall
    apart.
    Chosen on: simulated streets."""

    min_probability: float = 0.5
    """A track gives up its proposal for a piece only if the posterior of its class is at least this. Less: tracks of
    false people become longer.
    Chosen on: drives with false people, by the length of their tracks."""

    min_points: int = 8
    """Least number of points that are split off, and that remain. Less: pieces of a few points measure positions.
    Chosen on: judgement."""

    min_share: float = 0.4
    """Least share of a track's last points that a piece must hold; a proposal with less may be replaced by a piece.
    Greater: fewer splits.
    Chosen on: judgement."""

    max_drop_m: float = 0.4
    """Greatest distance of the top of a piece below the expected top [m]. Greater: low things are split off as
    people.
    Chosen on: judgement."""

    min_hits: int = 4
    """Hits a track needs before known parts are joined to it. A proposal whose own track has fewer may become a new
    part of a car beside it. Greater: fewer known parts and more new parts are joined.
    Chosen on: judgement."""


@dataclass(frozen=True)
class TrackingTuning:
    """Everything that is chosen in the tracking stage."""

    filter: FilterTuning = FilterTuning()
    motion_filter: MotionFilterTuning = MotionFilterTuning()
    motion_evidence: MotionEvidenceTuning = MotionEvidenceTuning()
    sight: SightTuning = SightTuning()
    kdop_association: KdopAssociationTuning = KdopAssociationTuning()
    paper_association: PaperAssociationTuning = PaperAssociationTuning()
    extent: ExtentTuning = ExtentTuning()
    rest: RestTuning = RestTuning()
    hiding: HidingTuning = HidingTuning()
    regrouping: RegroupingTuning = RegroupingTuning()
