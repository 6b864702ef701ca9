"""Figures that several experiments report, from the tables of a replay."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from modt.classes import CLASS_NAMES
from modt.types import NONE, Bool, Int
from modt_desk.evaluation.track_score import track_scores
from modt_desk.evaluation.truth import CLASSIFIED, Role
from modt_desk.experiments.estimate import Estimate, Ranking, ratio
from modt_desk.experiments.judged import Judged

OBJECTS = CLASS_NAMES[1:]
NOTHING = Estimate(None)


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure of an experiment.

    Attributes:
        variant: what is compared.
        at: value that is swept, None of a single one.
        quantity: its name, with its unit.
        estimate: the figure.
    """

    variant: str
    at: float | None
    quantity: str
    estimate: Estimate


def rankings(judged: Judged) -> Iterator[tuple[str, Ranking]]:
    """The ranking of each class of objects."""
    objects = judged.objects
    for c, name in enumerate(OBJECTS, 1):
        counted = (objects["class"] == c) & np.isin(objects["role"], CLASSIFIED) & objects["to_classify"]
        yield name, Ranking.of(objects, judged.proposals, c, counted)


def precisions(judged: Judged, variant: str, at: float | None = None) -> Iterator[Figure]:
    """Average precision by class, and their mean."""
    found = [(name, ranking.average_precision()) for name, ranking in rankings(judged)]
    for name, estimate in found:
        yield Figure(variant, at, f"AP {name}", estimate)
    values = [estimate.value for _, estimate in found if estimate.value is not None]
    yield Figure(variant, at, "AP mean", Estimate(float(np.mean(values))) if values else NOTHING)


def curves(judged: Judged, variant: str, at: float | None = None) -> Iterator[Figure]:
    """Precision over recall by class."""
    for name, ranking in rankings(judged):
        for recall, precision in ranking.precision_at_recalls():
            yield Figure(variant, recall, f"precision {name}", Estimate(precision))


@dataclass(frozen=True, slots=True)
class ObjectLives:
    """(n,) of each labelled object: frames to follow it in, frames followed, and discontinuities."""

    wanted: Int
    followed: Int
    breaks: Int

    @classmethod
    def of(cls, judged: Judged) -> ObjectLives:
        """As in the judgement of runs."""
        rows = judged.objects
        rows = rows[rows["to_follow"] & (rows["class"] > 0) & (rows["role"] != Role.IGNORED) & (rows["id"] != NONE)]
        rows = np.sort(rows, order=["drive", "id", "frame"])
        names, unit = np.unique(rows[["drive", "id"]], return_inverse=True)
        seen = rows["track"] != NONE
        own, track = unit[seen], rows["track"][seen]
        broken = own[1:][(own[1:] == own[:-1]) & (track[1:] != track[:-1])]
        return cls(*(np.bincount(which, minlength=len(names)) for which in (unit, own, broken)))


def lives(judged: Judged, variant: str, at: float | None = None) -> Iterator[Figure]:
    """Life of the tracks of objects, and what ends it early."""
    found = ObjectLives.of(judged)
    if not len(found.wanted):
        return
    scores = track_scores(judged.objects, judged.proposals)["all"]
    once = np.ones(len(found.wanted))
    yield Figure(variant, at, "objects", Estimate(len(found.wanted)))
    yield Figure(variant, at, "frames", Estimate(len(judged.frames)))
    yield Figure(variant, at, "mis-associations", Estimate(scores.mis_associations))
    yield Figure(variant, at, "discontinuities", Estimate(int(found.breaks.sum())))
    yield Figure(variant, at, "N_go of objects", ratio(found.followed, once + found.breaks))
    yield Figure(variant, at, "ideal N_go", ratio(found.wanted, once))


@dataclass(frozen=True, slots=True)
class TrackLives:
    """(n,) of each track: frames with a proposal, most of them on objects or not, and calls."""

    frames: Int
    on_object: Bool
    calls: Int

    @classmethod
    def of(cls, judged: Judged) -> TrackLives:
        """Table of all tracks."""
        rows = judged.proposals
        names, unit = np.unique(rows[["drive", "track"]], return_inverse=True)
        frames = np.bincount(unit, minlength=len(names))
        on_object = 2 * np.bincount(unit[rows["owner"] > 0], minlength=len(names)) > frames
        number = {name: k for k, name in enumerate(names.tolist())}
        own = np.array([number[name] for name in judged.calls[["drive", "track"]].tolist()], np.int64)
        return cls(frames, on_object, np.bincount(own, minlength=len(names)))


def efficiencies(judged: Judged, variant: str, at: float | None = None) -> Iterator[Figure]:
    """beta, of all proposals and of those of objects."""
    tracks = TrackLives.of(judged)
    of = tracks.on_object
    yield Figure(variant, at, "beta", ratio(tracks.calls, tracks.frames))
    yield Figure(variant, at, "beta of objects", ratio(tracks.calls[of], tracks.frames[of]))
