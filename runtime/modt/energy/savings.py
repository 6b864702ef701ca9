"""The step from gamma = N_go to the measured ratio, term by term.

Equation 3 has two costs and one life. A real run adds: tracks that end unclassified, views beyond the first in
`accurate` mode and after a track was lost, views that cost more or less than the average proposal, and the cost of
tracking, scheduling and fusion, which both sides pay. Each is one parameter here, neutral in the paper; replacing
the neutral values one by one gives the terms, whose sum is the whole deviation by construction.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from modt.energy.prediction import PaperModel


@dataclass(frozen=True, slots=True)
class Counts:
    """The work of one run.

    Attributes:
        frames: M.
        proposals: over all frames.
        foreground: proposals of a track whose class is an object's.
        tracks: created.
        classified_tracks: tracks classified at least once.
        classified: proposals classified.
        reacquired: classifications of a track that was lost in the frame before and classified earlier.
        points: processed by the network.
        calls: of the classifier.
    """

    frames: int
    proposals: int
    foreground: int
    tracks: int
    classified_tracks: int
    classified: int
    reacquired: int
    points: int
    calls: int

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


@dataclass(frozen=True, slots=True)
class UnitCosts:
    """Energy of units of work, all in joules or all in CPU seconds.

    Attributes:
        seg: E(seg), a frame.
        track: tracking of a frame, as in tracking-by-detection.
        class_call, class_item, class_point: of a call of the classifier, of a proposal in it, and of a point of it.
    """

    seg: float
    track: float
    class_call: float
    class_item: float
    class_point: float

    def classification(self, counts: Counts) -> float:
        """Energy of all classifications of a run."""
        return self.class_call * counts.calls + self.class_item * counts.classified + self.class_point * counts.points

    def e_class(self, counts: Counts) -> float:
        """E(class) of a run: mean over its proposals classified, with their shares of the calls."""
        return self.classification(counts) / counts.classified if counts.classified else 0.0


@dataclass(frozen=True, slots=True)
class OtherCosts:
    """Mean energy a frame of the stages that Equation 2 leaves out, in the unit of UnitCosts.

    Attributes:
        track: tracking.
        schedule: scheduling and fusion.
    """

    track: float
    schedule: float


@dataclass(frozen=True, slots=True)
class FullModel:
    """Equation 3 with the costs it leaves out; every added parameter is neutral by default.

    Attributes:
        e_seg: E(seg).
        e_class: E(class) of tracking-by-detection.
        n: proposals a frame.
        n_go: N_go.
        classified_share: share of the tracks classified at least once.
        repeats: further classifications a track, without those after a loss.
        reacquired: further classifications a track after it was lost.
        view_cost_ratio: E(class) of the views selected over e_class.
        track: tracking common to both runs, a frame.
        extra_track1, extra_track2: tracking beyond that, a frame, of tracking-by-detection and of the run.
        schedule1, schedule2: scheduling and fusion a frame, of tracking-by-detection and of the run.
    """

    e_seg: float
    e_class: float
    n: float
    n_go: float
    classified_share: float = 1.0
    repeats: float = 0.0
    reacquired: float = 0.0
    view_cost_ratio: float = 1.0
    track: float = 0.0
    extra_track1: float = 0.0
    extra_track2: float = 0.0
    schedule1: float = 0.0
    schedule2: float = 0.0

    @property
    def views(self) -> float:
        """k: classifications a track."""
        return self.classified_share + self.repeats + self.reacquired

    @property
    def e1(self) -> float:
        """Energy a frame of tracking-by-detection."""
        return self.e_seg + self.n * self.e_class + self.track + self.extra_track1 + self.schedule1

    @property
    def e2(self) -> float:
        """Energy a frame of the run: n / N_go new tracks, each classified k times."""
        selected = self.n / self.n_go * self.views * self.view_cost_ratio * self.e_class
        return self.e_seg + selected + self.track + self.extra_track2 + self.schedule2

    @property
    def gamma(self) -> float:
        """E1 / E2; 1 where nothing costs anything."""
        return self.e1 / self.e2 if self.e2 else 1.0


@dataclass(frozen=True, slots=True)
class GammaTerm:
    """One reason why gamma is not N_go: its change of gamma, and gamma after it and all terms before it."""

    name: str
    change: float
    gamma: float


@dataclass(frozen=True, slots=True)
class Prediction:
    """Gamma predicted for a pair of runs.

    Attributes:
        model: the full model.
        paper: Equation 3, at the same a, n and N_go.
        terms: from gamma = N_go to the full model's gamma; their changes sum to the difference.
    """

    model: FullModel
    paper: PaperModel
    terms: tuple[GammaTerm, ...]

    def explain(self, measured: float) -> tuple[GammaTerm, ...]:
        """The terms, and the remainder up to the measured ratio."""
        remainder = GammaTerm("not explained (measured - predicted)", measured - self.model.gamma, measured)
        return (*self.terms, remainder)


def predict(baseline: Counts, run: Counts, costs: UnitCosts, other1: OtherCosts, other2: OtherCosts) -> Prediction:
    """Gamma of a run over tracking-by-detection, from the counts of both and unit costs.

    Args:
        baseline: tracking-by-detection on the same stream.
        run: the proposed pipeline.
        costs: measured on neither of the two.
        other1: further costs of the baseline.
        other2: further costs of the run.
    """
    tracks = run.tracks or 1
    e_class = costs.e_class(baseline)
    paper = PaperModel(
        e_seg=costs.seg, e_class=e_class, n_obj=baseline.n_obj, n_bg=baseline.n - baseline.n_obj, n_go=run.n_go
    )
    repeats = run.classified - run.classified_tracks - run.reacquired
    view_cost_ratio = costs.e_class(run) / e_class if e_class and run.classified else 1.0
    extra1, extra2 = other1.track - costs.track, other2.track - costs.track
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
    model = FullModel(e_seg=costs.seg, e_class=e_class, n=baseline.n, n_go=run.n_go)
    for name, change in steps.items():
        before, model = model.gamma, replace(model, **change)
        terms.append(GammaTerm(name, model.gamma - before, model.gamma))
    return Prediction(model, paper, tuple(terms))
