"""Selection and fusion of views."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from modt.classes import ObjectClass
from modt.classification.fusion import EveryFrame, KeyViews, OneView
from modt.classification.prior import object_probability_reaches
from modt.config import FusionConfig
from modt.pipeline import Fusion
from modt.types import NONE, Bool, Float64, Int, Proposals, Tracks
from tests.classification.scenes import blobs, new_tracks

PAPER = FusionConfig(
    prior=(0.25, 0.25, 0.25),
    start_frame=1,
    review_point_ratio=None,
    extent_change=0.3,
    memory=1.0,
    box_update_weight=0.0,
    mismatch_probability=0.0,
)
ALL = (EveryFrame(), OneView(FusionConfig()), KeyViews(FusionConfig()), KeyViews(PAPER))


def scene(counts: tuple[int, ...] = (50, 50)) -> tuple[Proposals, Tracks]:
    _, proposals = blobs(list(counts), np.random.default_rng(3))
    return proposals, new_tracks(proposals)


def moved(proposals: Proposals, **columns: np.ndarray) -> Proposals:
    return dataclasses.replace(proposals, **columns)


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
    rows = np.arange(2)
    for view in views:
        fusion.fuse(tracks, proposals, rows, view)
        tracks.age += 1
        assert np.isfinite(tracks.posterior).all()
        assert (tracks.posterior > 0).all()
        np.testing.assert_allclose(tracks.posterior.sum(axis=1), 1.0)


@given(
    arrays(np.float64, (5, 4), elements=st.floats(0.05, 1.0)),
    arrays(np.float64, (3,), elements=st.floats(0.02, 0.3)),
)
def test_key_views_are_fused_by_equation_6(views: Float64, prior: Float64) -> None:
    views = views / views.sum(axis=1, keepdims=True)
    config = dataclasses.replace(PAPER, prior=(prior[0], prior[1], prior[2]), object_threshold=1.0)
    proposals, tracks = scene((50,))
    fusion = KeyViews(config)
    full = np.append(1 - prior.sum(), prior)
    expected = full.copy()
    for view in views:
        fusion.fuse(tracks, proposals, np.array([0]), view[None])
        expected = expected * view / full  # slow reference: P(X) times each P(X|Y) / P(X)
        expected /= expected.sum()
        if expected.min() < 1e-3:
            return  # the floor applies from here on
        np.testing.assert_allclose(tracks.posterior[0], expected, rtol=1e-6)
    assert tracks.views[0] == len(views)


def test_no_class_is_excluded_for_good() -> None:
    proposals, tracks = scene((50,))
    fusion = KeyViews(PAPER)
    for _ in range(50):
        fusion.fuse(tracks, proposals, np.array([0]), np.array([[1.0, 0.0, 0.0, 0.0]]))
    for _ in range(3):
        fusion.fuse(tracks, proposals, np.array([0]), np.array([[0.01, 0.97, 0.01, 0.01]]))
    assert tracks.posterior[0].argmax() == 1


def test_every_frame_requests_all_tracks_with_a_proposal() -> None:
    proposals, tracks = scene()
    tracks.final[:] = True
    tracks.proposal[1] = NONE
    assert EveryFrame().asks(tracks, proposals, np.zeros(2, np.bool_)).tolist() == [True, False]


def test_efficient_requests_one_certain_view() -> None:
    proposals, tracks = scene()
    fusion = OneView(FusionConfig(first_view_min_hits=3))
    asking, tracks.hits[:] = np.array([True, True]), 3
    assert fusion.asks(tracks, proposals, asking).all()
    assert fuse(fusion, tracks, proposals, np.array([0]), np.array([[0.03, 0.95, 0.01, 0.01]])).all()
    assert fusion.asks(tracks, proposals, asking).tolist() == [False, True]
    tracks.hits[1] = 2  # too few
    assert not fusion.asks(tracks, proposals, asking).any()


def test_the_first_view_of_the_paper_is_final_whatever_it_says() -> None:
    proposals, tracks = scene((50,))
    likelihood = np.array([[0.4, 0.2, 0.2, 0.2]])
    assert not fuse(OneView(FusionConfig()), tracks, proposals, np.array([0]), likelihood).any()
    assert fuse(OneView(FusionConfig(first_view_final="any")), tracks, proposals, np.array([0]), likelihood).all()


def test_each_mode_has_its_threshold_of_final_background() -> None:
    proposals, tracks = scene((50,))
    config = FusionConfig(prior=(0.25, 0.25, 0.25), background_threshold=0.4, first_view_background_threshold=0.9)
    row, likely, clear = np.array([0]), np.array([[0.6, 0.2, 0.1, 0.1]]), np.array([[0.95, 0.03, 0.01, 0.01]])
    assert not fuse(OneView(config), tracks, proposals, row, likely).any()
    assert fuse(OneView(config), tracks, proposals, row, clear).all()
    proposals, tracks = scene((50,))
    assert fuse(KeyViews(config), tracks, proposals, row, likely).all()


def test_an_uncertain_view_of_efficient_is_replaced_by_one_with_clearly_more_points() -> None:
    config = FusionConfig(review_point_ratio=2.0, review_extra_points=5)
    proposals, tracks = scene((50,))
    fusion, asking, tracks.hits[:] = OneView(config), np.array([True]), config.first_view_min_hits
    assert not fuse(fusion, tracks, proposals, np.array([0]), np.array([[0.5, 0.1, 0.3, 0.1]])).any()
    assert not fusion.asks(tracks, moved(proposals, offsets=np.array([0, 105])), asking).any()
    nearer = moved(proposals, offsets=np.array([0, 106]))
    assert fusion.asks(tracks, nearer, asking).all()
    assert not OneView(dataclasses.replace(config, review_point_ratio=None)).asks(tracks, nearer, asking).any()
    clear = np.array([[0.03, 0.01, 0.95, 0.01]])
    assert fuse(fusion, tracks, nearer, np.array([0]), clear).all()
    np.testing.assert_allclose(tracks.posterior, clear, rtol=1e-6)


def test_a_further_view_counts_more_than_the_evidence_before_it() -> None:
    config = dataclasses.replace(PAPER, memory=0.5)
    fusion, proposals, tracks = after_a_view(config)
    first, second = np.array([0.2, 0.6, 0.1, 0.1]), np.array([0.3, 0.3, 0.3, 0.1])
    tracks.views[:] = 1
    fusion.fuse(tracks, proposals, np.array([0]), second[None])
    expected = first**0.5 * second
    np.testing.assert_allclose(tracks.posterior[0], expected / expected.sum(), rtol=1e-6)


def test_a_distinct_first_view_is_certain() -> None:
    proposals, tracks = scene()
    fusion = KeyViews(FusionConfig())
    view = np.array([[0.98, 0.01, 0.005, 0.005], [0.5, 0.3, 0.1, 0.1]])
    assert fusion.fuse(tracks, proposals, np.arange(2), view).tolist() == [True, False]
    assert tracks.views.tolist() == [1, 0]


def test_an_uncertain_early_view_is_replaced_at_the_start_frame() -> None:
    proposals, tracks = scene((50,))
    fusion, asking = KeyViews(FusionConfig(start_frame=3)), np.array([True])
    misled, clear = np.array([[0.1, 0.1, 0.7, 0.1]]), np.array([[0.2, 0.6, 0.1, 0.1]])
    fusion.fuse(tracks, proposals, np.array([0]), misled)
    np.testing.assert_allclose(tracks.posterior[0], misled[0], rtol=1e-6)
    tracks.age[:] = 2
    assert not fusion.asks(tracks, proposals, asking).any()
    tracks.age[:] = 3
    assert fusion.asks(tracks, proposals, asking).all()
    fusion.fuse(tracks, proposals, np.array([0]), clear)
    np.testing.assert_allclose(tracks.posterior[0], clear[0], rtol=1e-6)


def test_a_final_class_of_few_points_is_reviewed_with_more() -> None:
    _, proposals = blobs([10, 10, 100], np.random.default_rng(0))
    tracks = new_tracks(proposals)
    config = FusionConfig(review_point_ratio=4.0, review_max_points=60, memory=1.0)
    fusion = KeyViews(config)
    sure = np.tile([0.99, 0.005, 0.0025, 0.0025], (3, 1))
    assert fuse(fusion, tracks, proposals, np.arange(3), sure).all()
    tracks.proposal[1] = NONE
    near = moved(proposals, offsets=np.array([0, 50, 100, 600]))
    asking = np.zeros(3, np.bool_)
    assert fusion.asks(tracks, near, asking).tolist() == [True, False, False]
    uncertain = np.array([[0.3, 0.5, 0.1, 0.1]])
    assert not fuse(fusion, tracks, near, np.array([0]), uncertain).any()
    prior = np.append(1 - sum(config.prior), config.prior)
    expected = (sure[0] / prior) ** (10 / 50) * uncertain[0]  # previous evidence weighted by the ratio of points
    np.testing.assert_allclose(tracks.posterior[0], expected / expected.sum(), rtol=1e-6)
    nearer = moved(proposals, offsets=np.array([0, 200, 210, 310]))
    tracks.age[:] = 9
    wants_class = np.array([True, False, False])  # the state machine asks again for a class in doubt
    assert fusion.asks(tracks, nearer, wants_class)[0]
    tracks.final[0] = True
    never = KeyViews(FusionConfig(review_point_ratio=None))
    assert not never.asks(tracks, near, asking).any()


def after_a_view(config: FusionConfig) -> tuple[KeyViews, Proposals, Tracks]:
    proposals, tracks = scene((50,))
    fusion = KeyViews(config)
    fusion.fuse(tracks, proposals, np.array([0]), np.array([[0.2, 0.6, 0.1, 0.1]]))
    tracks.age[:] = config.start_frame
    return fusion, proposals, tracks


def asks(fusion: KeyViews, tracks: Tracks, proposals: Proposals) -> bool:
    tracks.box = proposals.box.copy()
    return bool(fusion.asks(tracks, proposals, np.array([True]))[0])


def test_an_unchanged_view_is_not_independent() -> None:
    fusion, proposals, tracks = after_a_view(PAPER)
    assert not asks(fusion, tracks, proposals)


@pytest.mark.parametrize(("points", "independent"), [(50, False), (59, False), (62, True), (38, True)])
def test_independence_by_change_of_points(points: int, independent: bool) -> None:
    fusion, proposals, tracks = after_a_view(PAPER)
    assert asks(fusion, tracks, moved(proposals, offsets=np.array([0, points]))) == independent


def test_point_change_is_that_of_the_most_probable_class() -> None:
    config = dataclasses.replace(PAPER, point_change=(0.5, 0.9, 0.1, 0.9))
    fusion, proposals, tracks = after_a_view(config)
    more = moved(proposals, offsets=np.array([0, 60]))
    assert not asks(fusion, tracks, more)
    tracks.key_posterior[0] = [0.2, 0.2, 0.5, 0.1]
    assert asks(fusion, tracks, more)


def test_rotation_of_the_sensor_does_not_change_the_view() -> None:
    fusion, proposals, tracks = after_a_view(PAPER)
    box = proposals.box.copy()
    angle = np.deg2rad(60)
    c, s = np.cos(angle), np.sin(angle)
    box[:, :2] = box[:, :2] @ np.array([[c, s], [-s, c]])
    box[:, 6] += angle  # rotates in the sensor frame, static in the world
    assert not fusion.asks(tracks, moved(proposals, box=box), np.array([True]))[0]


@pytest.mark.parametrize(("factor", "independent"), [(1.2, False), (1.5, True), (0.5, True)])
def test_independence_by_change_of_extent(factor: float, independent: bool) -> None:
    fusion, proposals, tracks = after_a_view(PAPER)
    box = proposals.box * np.array([1, 1, 1, 1, 1, factor, 1])
    assert asks(fusion, tracks, moved(proposals, box=box)) == independent


@pytest.mark.parametrize("fusion", ALL)
def test_no_tracks(fusion: Fusion) -> None:
    proposals = Proposals.empty()
    tracks = new_tracks(proposals)
    assert len(fusion.asks(tracks, proposals, np.zeros(0, np.bool_))) == 0
    assert len(fusion.fuse(tracks, proposals, np.zeros(0, np.int64), np.zeros((0, 4)))) == 0


class FixedPrior:
    """Prior given by a test."""

    def __init__(self, *rows: list[float], pool_weight: float = 0.0) -> None:
        self.rows = np.array(rows)
        self.pool_weight = pool_weight

    def probability(self, proposals: Proposals) -> Float64:
        return self.rows

    def may_be_object(self, probability: Float64, threshold: float) -> Bool:
        return object_probability_reaches(probability, threshold)


WALL, UNCERTAIN, CAR = [0.999, 0.001 / 3, 0.001 / 3, 0.001 / 3], [0.95, 0.03, 0.01, 0.01], [0.2, 0.6, 0.1, 0.1]


@pytest.mark.parametrize(
    ("fusion", "asked"),
    [
        (KeyViews(FusionConfig(), FixedPrior(WALL, UNCERTAIN, CAR)), [False, True, True]),
        (OneView(FusionConfig(), FixedPrior(WALL, UNCERTAIN, CAR)), [False, False, True]),  # a higher threshold
    ],
)
def test_posterior_is_the_box_prior_before_the_first_view(fusion: KeyViews | OneView, asked: list[bool]) -> None:
    proposals, tracks = scene((50, 50, 50))
    tracks.hits[:] = 9
    assert fusion.asks(tracks, proposals, np.ones(3, np.bool_)).tolist() == asked
    np.testing.assert_allclose(tracks.posterior, [WALL, UNCERTAIN, CAR])
    assert not tracks.viewed.any()


def test_no_review_where_the_box_excludes_an_object() -> None:
    proposals, tracks = scene((20, 20))
    prior = FixedPrior(CAR, CAR)
    fusion = KeyViews(FusionConfig(review_point_ratio=2.0), prior)
    fusion.asks(tracks, proposals, np.ones(2, np.bool_))
    assert fuse(fusion, tracks, proposals, np.arange(2), np.array([[0.991, 0.003, 0.003, 0.003]] * 2)).all()
    prior.rows = np.array([WALL, CAR])
    nearer = moved(proposals, offsets=np.array([0, 100, 200]))
    assert fusion.asks(tracks, nearer, np.zeros(2, np.bool_)).tolist() == [False, True]


def test_posterior_follows_the_change_of_the_box_prior() -> None:
    proposals, tracks = scene((50,))
    prior = FixedPrior(UNCERTAIN)
    fusion = KeyViews(FusionConfig(box_update_weight=1.0, mismatch_probability=0.0), prior)
    view, asking = np.array([[0.5, 0.3, 0.1, 0.1]]), np.array([True])
    fusion.asks(tracks, proposals, asking)
    fusion.fuse(tracks, proposals, np.array([0]), view)
    prior.rows = np.array([CAR])
    fusion.asks(tracks, proposals, asking)
    expected = view[0] * np.array(CAR) / np.array(UNCERTAIN)
    np.testing.assert_allclose(tracks.posterior[0], expected / expected.sum(), rtol=1e-6)
    prior.rows = np.array([UNCERTAIN])
    fusion.asks(tracks, proposals, asking)
    np.testing.assert_allclose(tracks.posterior[0], view[0], rtol=1e-6)


def test_posterior_mixes_in_the_box_prior_by_mismatch_probability() -> None:
    proposals, tracks = scene((50, 50))
    prior = FixedPrior(CAR, CAR)
    fusion = KeyViews(FusionConfig(mismatch_probability=0.2), prior)
    fusion.asks(tracks, proposals, np.ones(2, np.bool_))
    view = np.array([[0.001, 0.997, 0.001, 0.001]] * 2)
    assert fuse(fusion, tracks, proposals, np.arange(2), view).all()
    np.testing.assert_allclose(tracks.posterior, view, rtol=1e-6)  # no mismatch in the frame of the view
    fusion.asks(tracks, proposals, np.zeros(2, np.bool_))
    np.testing.assert_allclose(tracks.posterior, 0.8 * view + 0.2 * np.array(CAR), rtol=1e-6)


@pytest.mark.parametrize("make", [OneView, KeyViews])
def test_a_final_class_stays_while_its_posterior_follows_the_box(make: type[OneView | KeyViews]) -> None:
    proposals, tracks = scene((50,))
    prior = FixedPrior(CAR)
    fusion, asking = make(FusionConfig(box_update_weight=1.0), prior), np.array([False])
    fusion.asks(tracks, proposals, np.array([True]))
    assert fuse(fusion, tracks, proposals, np.array([0]), np.array([[0.04, 0.92, 0.02, 0.02]])).all()
    prior.rows = np.array([WALL])
    assert not fusion.asks(tracks, proposals, asking).any()
    assert tracks.posterior[0].argmax() == ObjectClass.BACKGROUND
    assert tracks.key_posterior[0].argmax() == ObjectClass.CAR


def test_a_further_view_replaces_updates_by_the_box_since_the_last() -> None:
    views = np.array([[0.5, 0.3, 0.1, 0.1], [0.4, 0.4, 0.1, 0.1]])
    fused = []
    for between in (UNCERTAIN, CAR):
        proposals, tracks = scene((50,))
        prior = FixedPrior(UNCERTAIN)
        fusion = KeyViews(dataclasses.replace(PAPER, box_update_weight=1.0), prior)
        for box_prior, view in zip((UNCERTAIN, between), views, strict=True):
            prior.rows = np.array([box_prior])
            fusion.asks(tracks, proposals, np.array([True]))
            fusion.fuse(tracks, proposals, np.array([0]), view[None])
        fused.append(tracks.posterior[0].copy())
    np.testing.assert_allclose(fused[0], fused[1])


@pytest.mark.parametrize("pool_weight", [0.0, 0.4])
def test_a_further_view_equal_to_the_prior_changes_nothing(pool_weight: float) -> None:
    proposals, tracks = scene((50,))
    config = dataclasses.replace(PAPER, prior=(0.08, 0.02, 0.02))
    fusion, row = KeyViews(config, FixedPrior(UNCERTAIN, pool_weight=pool_weight)), np.array([0])
    fusion.asks(tracks, proposals, np.array([True]))
    first = np.array([[0.5, 0.3, 0.1, 0.1]])
    fusion.fuse(tracks, proposals, row, first)
    odds = (0.05 / 0.95) / (0.12 / 0.88)  # of an object, by the box, over those by frequency
    prior = np.array([0.88, 0.08, 0.02, 0.02]) * np.array([1.0, odds, odds, odds]) ** pool_weight
    fusion.fuse(tracks, proposals, row, prior[None] / prior.sum())
    np.testing.assert_allclose(tracks.posterior, first, rtol=1e-6)
    assert tracks.views.tolist() == [2]


def test_an_inherited_class_is_reviewed_where_the_box_may_be_an_object() -> None:
    proposals, tracks = scene((50, 50))
    tracks.final[:] = True
    asking = np.zeros(2, np.bool_)
    assert KeyViews(FusionConfig(), FixedPrior(WALL, CAR)).asks(tracks, proposals, asking).tolist() == [False, True]
    assert tracks.posterior.tolist() == [[1.0, 0.0, 0.0, 0.0]] * 2  # the inherited class holds until then
    assert not OneView(FusionConfig(), FixedPrior(WALL, CAR)).asks(tracks, proposals, asking).any()
