"""From gamma = N_go to the ratio that was measured, term by term.

Equation 3 knows two costs and one life. Reality adds: tracks that end unclassified, views beyond the first in
`accurate` mode and after a track was lost, views that cost more or less than the average proposal, and the cost of
tracking, scheduling and fusion, which both sides pay. Each is one parameter here, neutral in the paper; replacing
the neutral values one by one gives the terms, whose sum is the whole deviation by construction.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from modt.energy.prediction import PaperModel


@dataclass(frozen=True, slots=True)
class Counts:
    """What one run did.

    Attributes:
        frames: M.
        proposals: over all frames.
        foreground: of them, those taken for objects.
        tracks: begun.
        classified_tracks: classified at least once.
        classified: proposals classified.
        refound: of them, those of a track that was lost in the frame before and had been classified already.
        points: that the network saw.
        calls: of the classifier.
    """

    frames: int
    proposals: int
    foreground: int
    tracks: int
    classified_tracks: int
    classified: int
    refound: int
    points: int
    calls: int

    @property
    def n(self) -> float:
        """N_obj + N_bg: proposals a frame."""
        return self.proposals / self.frames if self.frames else 0.0

    @property
    def n_obj(self) -> float:
        """N_obj: those taken for objects, a frame."""
        return self.foreground / self.frames if self.frames else 0.0

    @property
    def n_go(self) -> float:
        """N_go: frames in which a track is seen, on average."""
        return self.proposals / self.tracks if self.tracks else 1.0

    @property
    def beta(self) -> float:
        """Classifications over those of tracking-by-detection (section V-A)."""
        return self.classified / self.proposals if self.proposals else 1.0


@dataclass(frozen=True, slots=True)
class UnitCosts:
    """Energy of units of work, in one unit throughout: joules, or CPU seconds.

    Attributes:
        seg: E(seg), a frame.
        track: following the proposals of a frame, as tracking-by-detection does.
        class_call, class_item, class_point: of a call of the classifier, a proposal in it, and a point of it.
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
        """E(class) over a run: of one proposal on average, its share of the calls and its points in it."""
        return self.classification(counts) / counts.classified if counts.classified else 0.0


@dataclass(frozen=True, slots=True)
class Beside:
    """What a run paid beside segmentation and classification, a frame, in the unit of its costs.

    Attributes:
        track: tracking.
        choose: scheduling and fusion.
    """

    track: float
    choose: float


@dataclass(frozen=True, slots=True)
class Model:
    """Equation 3 with what it leaves out; every added parameter has its neutral value by default.

    Attributes:
        e_seg: E(seg).
        e_class: E(class) of tracking-by-detection.
        n: proposals a frame.
        n_go: frames in which a track is seen.
        reached: share of the tracks that are ever classified.
        repeats: further classifications a track of which the track was not lost before.
        refound: further classifications a track after it was lost.
        dearness: E(class) of the views chosen over e_class.
        track: what following costs both, a frame.
        remember1, remember2: what tracking costs beyond that, a frame: remembering settled classes, for one.
        choose1, choose2: scheduling and fusion a frame of tracking-by-detection and of the proposed pipeline.
    """

    e_seg: float
    e_class: float
    n: float
    n_go: float
    reached: float = 1.0
    repeats: float = 0.0
    refound: float = 0.0
    dearness: float = 1.0
    track: float = 0.0
    remember1: float = 0.0
    remember2: float = 0.0
    choose1: float = 0.0
    choose2: float = 0.0

    @property
    def views(self) -> float:
        """k: classifications a track."""
        return self.reached + self.repeats + self.refound

    @property
    def e1(self) -> float:
        """Energy a frame of tracking-by-detection."""
        return self.e_seg + self.n * self.e_class + self.track + self.remember1 + self.choose1

    @property
    def e2(self) -> float:
        """Energy a frame of the proposed pipeline: n / n_go new tracks, each classified k times."""
        chosen = self.n / self.n_go * self.views * self.dearness * self.e_class
        return self.e_seg + chosen + self.track + self.remember2 + self.choose2

    @property
    def gamma(self) -> float:
        """E1 / E2; 1 where nothing costs anything."""
        return self.e1 / self.e2 if self.e2 else 1.0


@dataclass(frozen=True, slots=True)
class Deviation:
    """One reason why gamma is not N_go.

    Attributes:
        name: of the reason.
        change: of gamma when it is taken into account, after those before it.
        gamma: with it and all before it.
    """

    name: str
    change: float
    gamma: float


@dataclass(frozen=True, slots=True)
class Prediction:
    """What is predicted for a pair of runs.

    Attributes:
        model: the full one.
        paper: Equation 3 as it stands, at the same a, n and N_go.
        terms: from gamma = N_go to the full model's gamma; their changes add up to the difference.
    """

    model: Model
    paper: PaperModel
    terms: tuple[Deviation, ...]

    def explain(self, measured: float) -> tuple[Deviation, ...]:
        """The terms, and what none of them explains, up to the ratio measured."""
        rest = Deviation("not explained (measured - predicted)", measured - self.model.gamma, measured)
        return (*self.terms, rest)


def predict(baseline: Counts, run: Counts, costs: UnitCosts, beside1: Beside, beside2: Beside) -> Prediction:
    """Gamma of a run over tracking-by-detection, from what both counted and what the units cost.

    Args:
        baseline: of tracking-by-detection on the same stream.
        run: of the proposed pipeline.
        costs: measured on neither of the two.
        beside1: what tracking-by-detection paid for what Equation 2 does not know.
        beside2: what the proposed pipeline paid for it.
    """
    tracks = run.tracks or 1
    e_class = costs.e_class(baseline)
    n_obj, n = baseline.n_obj, baseline.n
    paper = PaperModel(e_seg=costs.seg, e_class=e_class, n_obj=n_obj, n_bg=n - n_obj, n_go=run.n_go)
    repeats = run.classified - run.classified_tracks - run.refound
    steps: tuple[tuple[str, dict[str, float]], ...] = (
        ("tracks that end unclassified", {"reached": run.classified_tracks / tracks}),
        ("further views of a track", {"repeats": repeats / tracks}),
        ("views after a track was lost", {"refound": run.refound / tracks}),
        (
            "cost of the views chosen",
            {"dearness": costs.e_class(run) / e_class if e_class and run.classified else 1.0},
        ),
        ("tracking, which both pay", {"track": costs.track}),
        (
            "tracking, which the mode pays beyond that",
            {"remember1": beside1.track - costs.track, "remember2": beside2.track - costs.track},
        ),
        ("scheduling and fusion", {"choose1": beside1.choose, "choose2": beside2.choose}),
    )
    terms = [Deviation("segmentation is not free (Equation 3 in full)", paper.gamma - paper.n_go, paper.gamma)]
    model = Model(e_seg=costs.seg, e_class=e_class, n=n, n_go=run.n_go)
    for name, change in steps:
        before, model = model.gamma, replace(model, **change)
        terms.append(Deviation(name, model.gamma - before, model.gamma))
    return Prediction(model, paper, tuple(terms))
