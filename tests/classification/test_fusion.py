"""Selection and fusion of views, boxes and motion."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from modt.classes import ObjectClass
from modt.classification import fusion as rule
from modt.classification.fusion import EveryFrame, FirstViews, FurtherViews, FusedTracks
from modt.classification.motion_witness import log_likelihood
from modt.classification.prior import FrequencyPrior, object_probability_reaches
from modt.classification.product_fusion import AnyView, KeyViews
from modt.config import FusionConfig
from modt.pipeline import Fusion
from modt.types import NONE, Bool, Float64, Int, Proposals, Tracks
from tests.classification.scenes import blobs, new_tracks

CONFIG = FusionConfig()
FREQUENCY = np.array([0.88, 0.08, 0.02, 0.02])
ALIKE = FrequencyPrior(FREQUENCY)
MODES = (FirstViews, FurtherViews, AnyView, KeyViews)
ALL = (EveryFrame(), *(mode(CONFIG, ALIKE) for mode in MODES))
ROW, YES = np.array([0]), np.array([True])
WALL, UNCERTAIN, CAR = [0.999, 0.001 / 3, 0.001 / 3, 0.001 / 3], [0.95, 0.03, 0.01, 0.01], [0.2, 0.6, 0.1, 0.1]
DOUBTFUL = np.array([[0.4, 0.2, 0.2, 0.2]])
LIKE_ANY = [0.8, 0.1, 0.05, 0.05]
SURELY_BACKGROUND = np.array([[0.997, 0.001, 0.001, 0.001]])
CLEARLY_A_CAR = np.array([[0.001, 0.997, 0.001, 0.001]])


class FixedPrior:
    """Prior given by a test."""

    frequency = FREQUENCY

    def __init__(self, *rows: list[float], pool_weight: float = 0.0) -> None:
        self.rows = np.array(rows)
        self.pool_weight = pool_weight

    def probability(self, proposals: Proposals) -> Float64:
        return self.rows

    def may_be_object(self, probability: Float64, threshold: float) -> Bool:
        return object_probability_reaches(probability, threshold)


def scene(counts: tuple[int, ...] = (50, 50)) -> tuple[Proposals, Tracks]:
    _, proposals = blobs(list(counts), np.random.default_rng(3))
    tracks = new_tracks(proposals)
    tracks.hits[:] = tracks.age[:] = 3
    return proposals, tracks


def with_points(proposals: Proposals, *counts: int) -> Proposals:
    return dataclasses.replace(proposals, offsets=np.append(0, np.cumsum(counts)))


def fuse(fusion: Fusion, tracks: Tracks, proposals: Proposals, rows: Int, likelihood: Float64) -> Bool:
    """Fuse, and make final what is certain, as the state machine does."""
    certain = fusion.fuse(tracks, proposals, rows, likelihood)
    tracks.final[rows] = certain
    return certain


@pytest.mark.parametrize("fusion", ALL)
@given(
    views=st.lists(
        arrays(np.float64, (2, 4), elements=st.floats(allow_nan=True, allow_infinity=True)), min_size=1, max_size=8
    )
)
def test_posterior_stays_a_distribution_for_any_likelihood(fusion: Fusion, views: list[Float64]) -> None:
    proposals, tracks = scene()
    for view in views:
        fusion.asks(tracks, proposals, np.ones(2, np.bool_))
        fusion.fuse(tracks, proposals, np.arange(2), view)
        tracks.age += 1
        assert np.isfinite(tracks.posterior).all()
        assert (tracks.posterior > 0).all()
        np.testing.assert_allclose(tracks.posterior.sum(axis=1), 1.0)


@pytest.mark.parametrize("fusion", ALL)
def test_no_tracks(fusion: Fusion) -> None:
    proposals = Proposals.empty()
    tracks = new_tracks(proposals)
    assert len(fusion.asks(tracks, proposals, np.zeros(0, np.bool_))) == 0
    assert len(fusion.fuse(tracks, proposals, np.zeros(0, np.int64), np.zeros((0, 4)))) == 0


def test_every_frame_requests_all_tracks_with_a_proposal() -> None:
    proposals, tracks = scene()
    tracks.final[:] = True
    tracks.proposal[1] = NONE
    assert EveryFrame().asks(tracks, proposals, np.zeros(2, np.bool_)).tolist() == [True, False]


@pytest.mark.parametrize(
    ("x", "length_m", "height_m", "asked"),
    [(2.5, 0.6, 1.7, True), (3.5, 0.6, 1.7, False), (2.5, 1.5, 1.7, False), (2.5, 0.6, 0.6, False)],
)
def test_what_may_be_a_person_near_by_is_asked_about_whatever_its_box_says(
    x: float, length_m: float, height_m: float, asked: bool
) -> None:
    proposals, tracks = scene()
    proposals.box[:, :6] = [x, 0.0, 0.0, length_m, 0.4, height_m]
    fusion = FurtherViews(CONFIG, FixedPrior(WALL, WALL))
    assert fusion.asks(tracks, proposals, np.ones(2, np.bool_)).tolist() == [asked] * 2


@pytest.mark.parametrize("mode", [FirstViews, FurtherViews])
def test_a_hidden_person_is_not_asked_about_and_keeps_what_is_known_of_the_box(mode: type[FusedTracks]) -> None:
    proposals, tracks = scene()
    fusion = mode(CONFIG, FixedPrior(CAR, CAR))
    tracks.hidden[0] = True
    assert fusion.asks(tracks, proposals, np.ones(2, np.bool_)).tolist() == [False, True]
    assert (tracks.box_evidence[0] == 0).all()
    assert (tracks.box_evidence[1] != 0).any()


@given(
    views=arrays(np.float64, (6, 4), elements=st.floats(0.05, 1.0)),
    boxes=arrays(np.float64, (6, 4), elements=st.floats(0.05, 1.0)),
    counts=arrays(np.int64, (6,), elements=st.integers(1, 400)),
    moved_m=st.floats(0, 20),
    pool_weight=st.sampled_from([0.0, 0.5]),
)
def test_posterior_is_that_of_the_plain_formula(
    views: Float64, boxes: Float64, counts: Int, moved_m: float, pool_weight: float
) -> None:
    """The slow reference: all views and boxes kept, and weighed anew in every frame."""
    views, boxes = (p / p.sum(axis=1, keepdims=True) for p in (views, boxes))
    proposals, tracks = scene((50,))
    prior = FixedPrior(boxes[0].tolist(), pool_weight=pool_weight)
    fusion = FusedTracks(CONFIG, prior)
    tracks.moved_m[:], tracks.observed_s[:], tracks.length_m[:] = moved_m, 3.0, 1.0
    motion = log_likelihood(tracks.moved_m, tracks.observed_s, tracks.length_m)[0]
    log_frequency = np.log(FREQUENCY / FREQUENCY.sum())
    seen: list[tuple[float, Float64]] = []
    box_mean = np.zeros(4)
    for k, (view, box, count) in enumerate(zip(views, boxes, counts.tolist(), strict=True)):
        now = with_points(proposals, count)
        prior.rows, tracks.hits[:] = box[None], k + 1
        fusion.observe(tracks, now)
        fusion.fuse(tracks, now, ROW, view[None])
        odds = (1 / box[0] - 1) / (1 / FREQUENCY[0] - 1)  # of an object by the box, over those by frequency
        pooled = log_frequency + pool_weight * np.log(odds) * np.array([0, 1, 1, 1])
        seen = [(weight * rule.FORGETTING, evidence) for weight, evidence in seen]
        seen.append((count**0.5, np.log(view) - pooled))
        gain = max(1 / (k + 1), 1 - rule.BOX_FORGETTING)
        box_mean = (1 - gain) * box_mean + gain * (np.log(box) - log_frequency)
        mean = sum(weight * evidence for weight, evidence in seen) / sum(weight for weight, _ in seen)
        log = log_frequency + (k + 1) ** rule.GROWTH * mean + rule.BOX_WEIGHT * box_mean + motion
        expected = np.exp(log) / np.exp(log).sum()
        if expected.min() < 1e-3:
            return  # the floor applies from here on
        expected = (1 - rule.MISMATCH_PROBABILITY) * expected + rule.MISMATCH_PROBABILITY * box
        np.testing.assert_allclose(tracks.posterior[0], expected, rtol=1e-6)


def test_a_view_of_many_points_outweighs_one_of_few() -> None:
    proposals, tracks = scene((400,))
    fusion = FusedTracks(CONFIG, ALIKE)
    fusion.observe(tracks, proposals)
    fusion.fuse(tracks, proposals, ROW, CLEARLY_A_CAR)
    fusion.fuse(tracks, with_points(proposals, 10), ROW, np.array([[0.1, 0.1, 0.7, 0.1]]))
    assert tracks.posterior[0].argmax() == ObjectClass.CAR


def test_the_same_view_again_adds_little() -> None:
    proposals, tracks = scene((50,))
    fusion, view = FusedTracks(CONFIG, ALIKE), np.array([[0.5, 0.3, 0.1, 0.1]])
    fusion.observe(tracks, proposals)
    odds = []
    for _ in range(3):
        fusion.fuse(tracks, proposals, ROW, view)
        odds.append(float(np.log(tracks.posterior[0, 1] / tracks.posterior[0, 0])))
    assert 0 < odds[2] - odds[0] < 0.5 * (odds[0] - np.log(FREQUENCY[1] / FREQUENCY[0]))


def test_motion_counts_once_however_long_it_lasts() -> None:
    proposals, tracks = scene((50,))
    fusion = FusedTracks(CONFIG, ALIKE)
    tracks.moved_m[:], tracks.observed_s[:], tracks.length_m[:] = 1.5, 5.0, 0.7
    fusion.observe(tracks, proposals)
    once = tracks.posterior.copy()
    for _ in range(20):
        fusion.observe(tracks, proposals)
    np.testing.assert_allclose(tracks.posterior, once)
    assert once[0, ObjectClass.PEDESTRIAN] > 2 * FREQUENCY[ObjectClass.PEDESTRIAN]


@pytest.mark.parametrize(
    ("make", "asked"), [(FurtherViews, [False, False, True]), (FirstViews, [False, False, True])]
)
def test_what_is_hardly_an_object_is_not_classified(make: type[FusedTracks], asked: list[bool]) -> None:
    proposals, tracks = scene((50, 50, 50))
    fusion = make(CONFIG, FixedPrior(WALL, UNCERTAIN, CAR))
    assert fusion.asks(tracks, proposals, np.ones(3, np.bool_)).tolist() == asked
    assert not tracks.viewed.any()
    assert tracks.posterior[:2, 1].max() < 0.05 < 0.2 < tracks.posterior[2, 1]


def test_efficient_requests_one_certain_view() -> None:
    proposals, tracks = scene()
    fusion, both = FirstViews(CONFIG, FixedPrior(CAR, CAR)), np.array([True, True])
    assert fusion.asks(tracks, proposals, both).all()
    assert fuse(fusion, tracks, proposals, ROW, CLEARLY_A_CAR).all()
    assert fusion.asks(tracks, proposals, ~tracks.final).tolist() == [False, True]
    tracks.hits[1] = 1  # too few
    assert not fusion.asks(tracks, proposals, ~tracks.final).any()


@pytest.mark.parametrize("make", [FirstViews, FurtherViews])
def test_an_uncertain_track_is_classified_again_with_clearly_more_points(make: type[FusedTracks]) -> None:
    proposals, tracks = scene((40,))
    fusion = make(CONFIG, FixedPrior(CAR))
    fusion.asks(tracks, proposals, YES)
    assert not fuse(fusion, tracks, proposals, ROW, DOUBTFUL).any()
    tracks.points[:] = 55
    assert not fusion.asks(tracks, proposals, YES).any()
    tracks.points[:] = 56
    assert fusion.asks(tracks, proposals, YES).all()


@pytest.mark.parametrize(("points", "asked"), [(50, False), (100, False), (110, True)])
def test_background_that_was_certain_from_afar_is_looked_at_again_near_by(points: int, asked: bool) -> None:
    proposals, tracks = scene((50,))
    fusion = FurtherViews(CONFIG, FixedPrior(LIKE_ANY))
    fusion.asks(tracks, proposals, YES)
    assert fuse(fusion, tracks, proposals, ROW, SURELY_BACKGROUND).all()
    tracks.age[:], tracks.points[:] = 200, points
    assert fusion.asks(tracks, proposals, ~YES)[0] == asked


def test_certain_background_whose_box_comes_to_look_like_an_object_is_looked_at_again() -> None:
    proposals, tracks = scene((50,))
    prior = FixedPrior(LIKE_ANY)
    fusion = FurtherViews(CONFIG, prior)
    fusion.asks(tracks, proposals, YES)
    assert fuse(fusion, tracks, proposals, ROW, SURELY_BACKGROUND).all()
    tracks.age[:] = 30
    assert not fusion.asks(tracks, proposals, ~YES).any()
    prior.rows = np.array([[0.01, 0.97, 0.01, 0.01]])
    assert any(fusion.asks(tracks, proposals, ~YES)[0] for _ in range(5))


@pytest.mark.parametrize(("view", "least", "most"), [(CLEARLY_A_CAR, 4, 4), (DOUBTFUL, 8, 12)])
def test_an_object_is_looked_at_again_at_growing_intervals(view: Float64, least: int, most: int) -> None:
    """An uncertain one more often, with as many points all the while."""
    proposals, tracks = scene((50,))
    fusion = FurtherViews(CONFIG, FixedPrior(CAR))
    tracks.age[:], asked = 0, []
    for frame in range(1, 80):
        tracks.age[:] = tracks.hits[:] = frame
        if fusion.asks(tracks, proposals, ~tracks.final)[0]:
            asked.append(frame)
            fuse(fusion, tracks, proposals, ROW, view)
    assert least <= len(asked) <= most
    assert (np.diff(asked, 2) >= 0).all()


def test_final_background_is_not_looked_at_again_while_its_box_stays() -> None:
    proposals, tracks = scene((50,))
    fusion = FurtherViews(CONFIG, FixedPrior(LIKE_ANY))
    for frame in range(1, 200):
        tracks.age[:] = tracks.hits[:] = frame
        if fusion.asks(tracks, proposals, ~tracks.final)[0]:
            fuse(fusion, tracks, proposals, ROW, np.array([[0.99, 0.004, 0.003, 0.003]]))
    assert tracks.final.all()
    assert tracks.views[0] == 1


def test_a_remembered_place_is_background_until_its_box_may_be_an_object() -> None:
    proposals, tracks = scene()
    tracks.final[:] = True
    nobody = np.zeros(2, np.bool_)
    assert FurtherViews(CONFIG, FixedPrior(WALL, CAR)).asks(tracks, proposals, nobody).tolist() == [False, True]
    assert tracks.posterior.tolist() == [[1.0, 0.0, 0.0, 0.0]] * 2
    assert not FirstViews(CONFIG, FixedPrior(WALL, CAR)).asks(tracks, proposals, nobody).any()


def test_lost_tracks_keep_their_posterior_and_ask_for_nothing() -> None:
    proposals, tracks = scene((50,))
    fusion = FurtherViews(CONFIG, FixedPrior(CAR))
    fusion.asks(tracks, proposals, YES)
    fuse(fusion, tracks, proposals, ROW, CLEARLY_A_CAR)
    before = tracks.posterior.copy()
    tracks.proposal[:], tracks.age[:] = NONE, 100
    assert not fusion.asks(tracks, proposals, YES).any()
    np.testing.assert_array_equal(tracks.posterior, before)


def test_background_is_as_certain_as_an_object_where_nobody_looks_again() -> None:
    certain = []
    for make in (FirstViews, FurtherViews):
        proposals, tracks = scene((50,))
        fusion = make(CONFIG, FixedPrior(FREQUENCY.tolist()))
        fusion.asks(tracks, proposals, YES)
        certain.append(bool(fusion.fuse(tracks, proposals, ROW, np.array([[0.97, 0.02, 0.005, 0.005]]))[0]))
    assert certain == [False, True]
