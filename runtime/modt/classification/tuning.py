"""Chosen values of the classification stage: what each does to the result, its unit, and what it was chosen on.

Values that a profile may set stand in `modt.config`; values that were fixed when a model was trained stand beside
the code that shares them with the training.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class BatchingTuning:
    """Division of the crops of a frame into calls of the network."""

    max_padding_points: int = 100
    """Points of padding that a batch takes on for its next crop [points]. More padding makes fewer but larger calls.

    Chosen on: judgement; the results do not depend on it.
    """


@dataclass(frozen=True)
class BodyTuning:
    """Second look at the body of a person in what the network takes for background.

    Chosen on: simulated people with loads, with a check on simulated streets and on KITTI scans.
    """

    radius_m: float = 0.3
    """Radius of a body [m]. With more, it holds more of loads."""
    top_m: float = 1.75
    """Height of the top of a body above the ground [m]. With more, it holds more of what hangs above people."""
    min_leg_m: float = 0.2
    """Height from which the middle of the points is that of the body [m]."""
    max_leg_m: float = 1.0
    """Height up to which the middle of the points is that of the body [m]. With more, loads move it."""
    min_share: float = 0.4
    """Least share of the points that are in the body. With less, parts of bushes are looked at."""
    min_points: int = 12
    """Points below which a body is not looked at. With less, poles are people."""
    min_height_m: float = 1.2
    """Least height of what is seen of a body [m]. With less, parts of bushes are looked at."""
    min_person: float = 0.7
    """Probability of a person from which the body counts in place of the whole. With less, trunks are people."""
    usual_length_m: float = 0.8
    """Length of a proposal up to which it is no more than a person [m]."""
    usual_top_m: float = 1.95
    """Height of the top above the ground up to which a proposal is no more than a person [m]."""
    max_length_m: float = 3.5
    """Length from which a proposal is no person with a load [m]."""
    max_top_m: float = 3.0
    """Height of the top above the ground from which a proposal is no person with a load [m]."""


@dataclass(frozen=True)
class MotionTuning:
    """Likelihood of the classes by motion and size, besides the table counted on simulated drives."""

    oversize_penalty: float = 3.0
    """Log-likelihood that a cyclist loses where the track is larger than one. With less, hidden cars are cyclists.

    Chosen on: parts of hidden cars that were reported as cyclists for 30 frames.
    """
    oversize_ratio: float = 1.1
    """Size over the greatest size of a cyclist from which a track is larger than one: a cyclist may once be seen
    together with something else.

    Chosen on: parts of hidden cars that were reported as cyclists for 30 frames.
    """
    whole_m: float = 6.0
    """Distance below which a vehicle shows its whole length or its width alone [m]. With more, partly hidden cars are
    reported later.

    Chosen on: simulated stalls, with a check on simulated streets and car parks.
    """
    vehicle_deviations: float = 3.0
    """Standard deviations from the usual length and width of a vehicle beyond which there is hardly any. With less,
    short cars are reported later.

    Chosen on: judgement.
    """
    between_penalty: float = 4.0
    """Log-likelihood that a vehicle loses where a near track is longer than one is wide and shorter than one is long.
    With less, stalls are cars. With more, near cars that something hides in part are reported later.

    Chosen on: as `whole_m`.
    """


@dataclass(frozen=True)
class EvidenceTuning:
    """Weights of views and boxes in the posterior of a track."""

    view_memory: float = 0.72
    """Weight of the views so far when a further one is added. With less, a track follows its latest views.

    Chosen on: judgement.
    """
    view_exponent: float = 0.22
    """n views count as n^view_exponent independent ones; 1 treats them as independent.

    Chosen on: judgement; log-odds of consecutive views of a car are correlated by .8 to .87.
    """
    full_points: int = 20
    """Points from which a view of what stands still has its full weight [points]. With more, far things of few points
    are reported less often, and far people who stand later.

    Chosen on: judgement, for a far sign; checked on 24 simulated drives of six sensors (seeds 700 and 701).
    """
    box_memory: float = 0.5
    """Weight of the boxes so far when a further one is added. With less, a track follows its latest boxes.

    Chosen on: judgement.
    """
    box_weight: float = 0.75
    """Weight of the mean evidence of the boxes beside that of the views.

    Chosen on: judgement.
    """
    mismatch_probability: float = 0.05
    """Probability of a wrong association; the posterior is mixed with the box prior by it.

    Chosen on: judgement.
    """
    background_threshold: float = 0.5
    """Posterior under equal class frequencies from which mode accurate confirms background. With less, background is
    confirmed sooner and classified less often.

    Chosen on: judgement.
    """


@dataclass(frozen=True)
class RequestTuning:
    """Conditions under which a track asks for a classification."""

    more_points_ratio: float = 1.25
    """An unconfirmed track is classified again at this multiple of the points of its last view.

    Chosen on: judgement.
    """
    far_more_points_ratio: float = 2.0
    """A confirmed track that may be an object is classified again at this multiple of the points of its last view.

    Chosen on: 48 simulated drives of six sensors (seeds 1000 to 1003).
    """
    more_points_offset: int = 5
    """Extra points beyond either multiple [points], the noise of the count from frame to frame.

    Chosen on: judgement.
    """
    first_view_min_hits: int = 2
    """Frames with a proposal that mode efficient waits for before the first view [frames]. More of them spare calls
    on spurious proposals.

    Chosen on: judgement.
    """
    review_age_ratio: float = 2.0
    """A confirmed object is classified again at this multiple of its age at the last view, and `review_frames` later.

    Chosen on: judgement.
    """
    review_frames: int = 10
    """See `review_age_ratio` [frames].

    Chosen on: judgement.
    """
    unconfirmed_age_ratio: float = 1.3
    """An unconfirmed track is classified again at this multiple of its age at the last view, and `unconfirmed_frames`
    later. With more, fewer calls are made and cars are recognised later.

    Chosen on: 48 simulated drives of six sensors (seeds 1000 to 1003).
    """
    unconfirmed_frames: int = 2
    """See `unconfirmed_age_ratio` [frames].

    Chosen on: 48 simulated drives of six sensors (seeds 1000 to 1003).
    """
    likely_background: float = 0.8
    """Posterior of background above which an unconfirmed track waits by `background_age_ratio`. With less, more
    tracks wait longer.

    Chosen on: judgement.
    """
    background_age_ratio: float = 2.0
    """The `unconfirmed_age_ratio` of a track that is probably background.

    Chosen on: judgement.
    """
    maybe_person: float = 0.25
    """Posterior of a pedestrian or cyclist above which an unconfirmed track may be a person: one view of a few points
    is weak evidence, and many of them are right. With less, more calls are made.

    Chosen on: judgement, for far walkers whose posterior stays below the threshold for a second or more.
    """
    person_frames: int = 4
    """Frames after which a possible person is classified again at the latest [frames].

    Chosen on: simulated drives, where it makes no more calls than without a rule for people.
    """
    first_view_points: int = 20
    """Points of a proposal from which mode accurate classifies what may be an object by its box, whatever its motion
    [points].

    Chosen on: people who stand still.
    """
    near_m: float = 3.0
    """Distance below which mode accurate classifies whatever may be a person by its size, however unlikely it is one
    by its box [m].

    Chosen on: tall people who stand in front of the sensor.
    """
    unseen_m: float = 15.0
    """Distance below which mode accurate classifies every track of `first_view_points` once, whatever its box [m].

    Chosen on: simulated people who sit, crouch and lie.
    """
    unseen_hits: int = 2
    """Frames with a proposal before a track is classified by `unseen_m` [frames]. More of them spare calls on
    spurious proposals.

    Chosen on: simulated people who sit, crouch and lie.
    """


@dataclass(frozen=True)
class FusionTuning:
    """Fusion of all that is known of a track, and its requests for further views."""

    motion: MotionTuning = MotionTuning()
    evidence: EvidenceTuning = EvidenceTuning()
    requests: RequestTuning = RequestTuning()


@dataclass(frozen=True)
class DecisionTuning:
    """Reported class, and class frequency of the stream."""

    min_background_frequency: float = 0.1
    """Least frequency of background among the proposals of a stream.

    Chosen on: judgement.
    """
    kept_probability: float = 0.4
    """A reported class is kept down to this probability if its threshold is higher. With less, doubtful classes stay.

    Chosen on: 48 simulated drives of six sensors (seeds 700 to 702, 710).
    """
    start_proposals: int = 2_000
    """Weight of the class frequency at the start, as a number of proposals.

    Chosen on: judgement.
    """
    memory_proposals: int = 20_000
    """Greatest weight of the stream so far, as a number of proposals. With less, the frequency changes faster.

    Chosen on: judgement.
    """
    certain_probability: float = 0.9
    """Posterior from which a person counts for the frequency of the class; a doubtful one counts as background. With
    less, many things that resemble people make each other people. With more, people in crowds are reported later.

    Chosen on: simulated vines, orchards, hedges and crowds.
    """
    max_frequency_ratio: float = 5.0
    """A class becomes at most so many times as frequent as the model assumes.

    Chosen on: judgement.
    """
    min_lookalike: float = 0.02
    """Posterior of a person from which a proposal resembles one a little. With less, plain background counts too.

    Chosen on: simulated vines, with a check on simulated streets, markets, car parks and postures.
    """
    max_lookalike: float = 0.15
    """Posterior of a person from which a proposal resembles one more than a little. With more, people in rare
    postures make each other doubtful.

    Chosen on: as `min_lookalike`.
    """
    usual_lookalikes: float = 0.12
    """Share of the proposals that may resemble people a little before the odds of people fall, by the square of the
    share. With less, people are reported later wherever bushes and posts stand.

    Chosen on: as `min_lookalike`.
    """
    lookalike_start: float = 200.0
    """Weight of the usual scene at the start, as a number of proposals. With more, vines are people for longer.

    Chosen on: as `min_lookalike`.
    """
    lookalike_memory: float = 1_000.0
    """Greatest number of proposals that count for the share, one to five seconds of them. With more, people are
    reported later after a robot has left an orchard.

    Chosen on: judgement.
    """


@dataclass(frozen=True)
class WorthTuning:
    """Worth of a call, which decides who comes first where the budget binds."""

    uncertainty_weight: float = 0.4
    """Weight of the normalised entropy of the posterior.

    Chosen on: judgement.
    """
    nearness_weight: float = 1.0
    """Weight of exp(-distance / `nearness_range_m`). With more, a crowd in the first frames is classified in order of
    distance.

    Chosen on: simulated crowds of 80 and 150.
    """
    novelty_weight: float = 0.3
    """Weight of the relative change of points since the last view.

    Chosen on: judgement.
    """
    nearness_range_m: float = 10.0
    """Distance at which nearness is 1/e [m]. With less, far objects wait longer.

    Chosen on: simulated crowds of 80 and 150.
    """
    waiting_weight: float = 0.1
    """Worth added per frame of waiting [1/frame], so that every call is made in the end.

    Chosen on: judgement.
    """


@dataclass(frozen=True)
class CallCostTuning:
    """Estimate of the CPU time of classifications."""

    memory: float = 0.98
    """Weight per frame of the past measurements in the fit. With less, the estimate follows the machine faster.

    Chosen on: judgement.
    """
    start_margin: float = 1.5
    """Estimate over the fit, at the start.

    Chosen on: judgement.
    """
    margin_step: float = 0.05
    """Increase of the margin's logarithm by an underestimate.

    Chosen on: judgement.
    """
    accepted_underestimates: float = 0.005
    """Share of underestimates at which the margin stays constant: half of the hundredth of the frames that may exceed
    their budget.

    Chosen on: simulated frames, of which at most one in a hundred may exceed its budget.
    """
    warm_up_weight: float = 0.2
    """Weight of a measurement before the first frame over that of a frame's.

    Chosen on: judgement.
    """
    starved_frames: int = 100
    """Starved frames since the last call after which one call may exceed the budget, which corrects an estimate that
    is too high [frames].

    Chosen on: judgement.
    """


@dataclass(frozen=True)
class ClassificationTuning:
    """All chosen values of the stage, one part a mechanism."""

    batching: BatchingTuning = BatchingTuning()
    body: BodyTuning = BodyTuning()
    fusion: FusionTuning = FusionTuning()
    decision: DecisionTuning = DecisionTuning()
    worth: WorthTuning = WorthTuning()
    call_cost: CallCostTuning = CallCostTuning()
