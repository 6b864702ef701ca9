"""Energy of both pipelines (section IV-D, Equations 2 and 3), and the step from N_go to the measured gamma.

All energies share one unit, which cancels in gamma: joules where a meter was read, CPU seconds otherwise.

Equation 3 has two costs and one track length. A real run adds: tracks that end unclassified, views beyond the first
in `accurate` mode and after a track was lost, views that cost more or less than the average proposal, and the cost of
tracking, scheduling and fusion, which both sides pay. Each is one parameter here, neutral in the paper. Replacing the
neutral values one by one gives the terms, whose sum is the whole deviation by construction.
"""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True)
class EnergyModel:
    """Equations 2 and 3 by their four parameters; the others, neutral by default, are costs that they leave out.

    In names, 1 is tracking-by-detection and 2 the proposed pipeline.
    """

    e_seg: float  # E(seg), of one segmentation
    e_class: float  # E(class), of one classification by tracking-by-detection
    n: float  # N_obj + N_bg, proposals a frame
    n_go: float  # N_go, mean length of a track in frames
    classified_share: float = 1.0  # share of the tracks that are classified at least once
    repeats: float = 0.0  # further classifications a track, without those after a loss
    reacquired: float = 0.0  # further classifications a track after it was lost
    view_cost_ratio: float = 1.0  # E(class) of the views selected over e_class
    track: float = 0.0  # common to both runs, a frame
    extra_track1: float = 0.0  # cost of tracking beyond the common part, by run
    extra_track2: float = 0.0
    schedule1: float = 0.0  # scheduling and fusion, a frame
    schedule2: float = 0.0

    @property
    def a(self) -> float:
        """E(class) / E(seg); infinite where segmentation costs nothing."""
        return self.e_class / self.e_seg if self.e_seg else float("inf")

    @property
    def views(self) -> float:
        """k: classifications a track; 1 in the paper."""
        return self.classified_share + self.repeats + self.reacquired

    @property
    def e1(self) -> float:
        """E1(M) / M: energy a frame of tracking-by-detection (Equation 2)."""
        return self.e_seg + self.n * self.e_class + self.track + self.extra_track1 + self.schedule1

    @property
    def e2(self) -> float:
        """E2(M) / M: energy a frame with n / N_go new tracks, each classified k times (Equation 2)."""
        selected = self.n / self.n_go * self.views * self.view_cost_ratio * self.e_class
        return self.e_seg + selected + self.track + self.extra_track2 + self.schedule2

    @property
    def gamma(self) -> float:
        """E1 / E2 (Equation 3); 1 where nothing costs anything."""
        return self.e1 / self.e2 if self.e2 else 1.0

    @property
    def short_form_error(self) -> float:
        """Relative error of the approximation gamma = N_go."""
        return self.n_go / self.gamma - 1.0


@dataclass(frozen=True)
class Counts:
    """The work of one run."""

    frames: int  # M
    proposals: int
    foreground: int  # proposals of a track whose class is an object's
    tracks: int
    classified_tracks: int  # at least once
    classified: int  # proposals
    reacquired: int  # classifications of a track that was lost in the frame before and classified earlier
    points: int  # processed by the network
    calls: int  # calls of the classifier
    sweep_points: int = 0
    alive: int = 0  # tracks, summed over the frames

    @property
    def n(self) -> float:
        """N_obj + N_bg: proposals a frame."""
        return self.proposals / self.frames if self.frames else 0.0

    @property
    def n_obj(self) -> float:
        """N_obj: foreground proposals a frame."""
        return self.foreground / self.frames if self.frames else 0.0

    @property
    def n_go(self) -> float:
        """N_go: mean number of frames in which a track has a proposal."""
        return self.proposals / self.tracks if self.tracks else 1.0

    @property
    def beta(self) -> float:
        """Classifications over those of tracking-by-detection (section V-A)."""
        return self.classified / self.proposals if self.proposals else 1.0


@dataclass(frozen=True)
class UnitCosts:
    """Energy of units of work, all in joules or all in CPU seconds."""

    seg: float  # E(seg), a frame
    track: float  # odometry and tracking of a frame, as in tracking-by-detection
    class_call: float
    class_item: float  # cost of a proposal in a call
    class_point: float

    def classification(self, counts: Counts) -> float:
        """Energy of all classifications of a run."""
        return self.class_call * counts.calls + self.class_item * counts.classified + self.class_point * counts.points

    def e_class(self, counts: Counts) -> float:
        """E(class) of a run: mean over its proposals classified, with their shares of the calls."""
        return self.classification(counts) / counts.classified if counts.classified else 0.0


@dataclass(frozen=True)
class OtherCosts:
    """Mean energy a frame of the stages that Equation 2 leaves out, in the unit of UnitCosts."""

    track: float  # odometry and tracking
    schedule: float  # scheduling and fusion


@dataclass(frozen=True)
class GammaTerm:
    """One reason why gamma is not N_go: its change of gamma, and gamma after it and all terms before it."""

    name: str
    change: float
    gamma: float


@dataclass(frozen=True)
class Reconciliation:
    """Gamma of a pair of runs, from their own counts and costs.

    It predicts nothing: N_go cancels against the count of tracks, and tracking and scheduling are those of the runs.
    """

    model: EnergyModel  # with all costs
    paper: EnergyModel  # Equation 3, at the same a, n and N_go
    terms: tuple[GammaTerm, ...]  # from gamma = N_go to the gamma of the model; their changes sum to the difference

    def explain(self, measured: float) -> tuple[GammaTerm, ...]:
        """The terms, and the remainder up to the measured ratio."""
        remainder = GammaTerm("not explained (observed - reconciled)", measured - self.model.gamma, measured)
        return (*self.terms, remainder)


def reconcile(
    baseline: Counts, run: Counts, costs: UnitCosts, other1: OtherCosts, other2: OtherCosts
) -> Reconciliation:
    """Gamma of a run over tracking-by-detection on the same stream, from the counts of both and unit costs.

    The unit costs are measured on neither of the two; other1 are further costs of the baseline, other2 of the run.
    """
    tracks = run.tracks or 1
    e_class = costs.e_class(baseline)
    paper = EnergyModel(costs.seg, e_class, baseline.n, run.n_go)
    model = paper
    repeats = run.classified - run.classified_tracks - run.reacquired
    view_cost_ratio = costs.e_class(run) / e_class if e_class and run.classified else 1.0
    extra1 = other1.track - costs.track
    extra2 = other2.track - costs.track
    steps: dict[str, dict[str, float]] = {
        "tracks that end unclassified": {"classified_share": run.classified_tracks / tracks},
        "further views of a track": {"repeats": repeats / tracks},
        "views after a track was lost": {"reacquired": run.reacquired / tracks},
        "cost of the views selected": {"view_cost_ratio": view_cost_ratio},
        "tracking common to both": {"track": costs.track},
        "tracking beyond that, by mode": {"extra_track1": extra1, "extra_track2": extra2},
        "scheduling and fusion": {"schedule1": other1.schedule, "schedule2": other2.schedule},
    }
    terms = [GammaTerm("segmentation is not free (Equation 3 in full)", paper.gamma - paper.n_go, paper.gamma)]
    for name, change in steps.items():
        before = model.gamma
        model = replace(model, **change)
        terms.append(GammaTerm(name, model.gamma - before, model.gamma))
    return Reconciliation(model, paper, tuple(terms))
