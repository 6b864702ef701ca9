import numpy as np
import pytest

from modt.classes import ObjectClass
from modt.types import NONE
from modt_evaluation.class_score import class_scores
from modt_evaluation.experiments.figures import Estimate, ObjectLengths, TrackWork, curves, precisions, ratio
from modt_evaluation.experiments.judged import CALL, FRAME, Judged
from modt_evaluation.rows import OBJECT, PROPOSAL, table
from modt_evaluation.truth import Role

CAR = int(ObjectClass.CAR)


def judged(n_objects: int, n_frames: int) -> Judged:
    """Cars that are detected in four of five frames, and as many tracks of other things."""
    rng = np.random.default_rng(0)
    ids, frames = (grid.ravel() for grid in np.meshgrid(np.arange(n_objects), np.arange(n_frames)))
    found = rng.random(len(ids)) < 0.8
    judged_rows = {"to_classify": True, "to_follow": True, "class": CAR}
    objects = table(OBJECT, len(ids), id=ids, frame=frames, track=np.where(found, ids, NONE), **judged_rows)
    score = np.concatenate([rng.uniform(0.3, 1.0, found.sum()), rng.uniform(0.0, 0.6, len(ids))])
    posterior = np.zeros((len(score), 4))
    posterior[:, CAR] = score
    posterior[:, 0] = 1 - score
    right = np.arange(len(score)) < found.sum()
    proposals = table(
        PROPOSAL,
        len(score),
        frame=np.concatenate([frames[found], frames]),
        track=np.concatenate([ids[found], 100 + ids]),
        posterior=posterior,
        label=np.where(right, CAR, 0),
        box_class=np.where(right, CAR, 0),
        to_classify=True,
        to_report=True,
        reported=np.where(score > 0.5, CAR, 0),
    )
    calls = table(CALL, n_objects, track=np.arange(n_objects))
    return Judged(np.zeros(n_frames, FRAME), objects, proposals, calls)


def estimate(made):
    """Average precision of cars."""
    return next(f for f in precisions(made) if f.quantity == "AP car").estimate


def test_average_precision_is_that_of_the_judgement():
    made = judged(5, 30)
    expected = class_scores(made.objects, made.proposals)["car"].average_precision
    car = estimate(made)
    assert car.value == pytest.approx(expected)
    assert car.n == 5
    assert car.low < car.value < car.high


def test_more_objects_have_a_narrower_interval_and_a_single_one_has_none():
    few, many, single = (estimate(judged(n, 20)) for n in (4, 64, 1))
    assert many.high - many.low < few.high - few.low
    assert single.value > 0
    assert single.low is single.high is None


def test_ratio_is_one_of_sums_and_resamples_whole_objects():
    assert ratio([1, 1], [1, 3]).value == 0.5
    assert ratio([2, 2, 2], [4, 4, 4]) == Estimate(0.5, 0.5, 0.5, 3)
    assert ratio([], []).value is None


def test_lives_of_objects_count_breaks_and_frames_without_a_track():
    objects = table(OBJECT, 6, id=[1, 1, 1, 1, 2, 2], frame=[0, 1, 2, 3, 0, 1], **{"class": CAR}, to_follow=True)
    objects["track"] = [7, NONE, 8, 8, 9, 9]
    found = ObjectLengths.of(Judged(np.zeros(0, FRAME), objects, np.zeros(0, PROPOSAL), np.zeros(0, CALL)))
    assert (found.wanted.tolist(), found.followed.tolist(), found.breaks.tolist()) == ([4, 2], [3, 2], [1, 0])


def test_lives_of_tracks_tell_objects_from_background():
    found = TrackWork.of(judged(3, 10))
    assert found.on_object.tolist() == [True] * 3 + [False] * 3
    assert found.calls.tolist() == [1] * 3 + [0] * 3


def test_further_objects_count_for_precision_alone():
    made = judged(5, 30)
    made.objects["role"][made.objects["id"] > 2] = Role.FURTHER
    made.objects["to_follow"] = made.objects["role"] != Role.FURTHER
    assert estimate(made).n == 5
    assert len(ObjectLengths.of(made).wanted) == 3


def test_a_curve_falls_from_the_most_probable_to_the_last_detected():
    found = [(f.at, f.estimate.value) for f in curves(judged(5, 30)) if f.quantity == "precision car"]
    recalls, values = zip(*found, strict=True)
    assert list(recalls) == sorted(recalls)
    assert list(values) == sorted(values, reverse=True)
    assert recalls[-1] <= 0.95
