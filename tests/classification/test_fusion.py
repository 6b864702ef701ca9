"""Which views are asked for, and what they add up to."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from modt.classes import ObjectClass
from modt.classification.fusion import EveryFrame, FirstView, KeyViews
from modt.classification.prior import at_least
from modt.config import FusionConfig
from modt.pipeline import Fusion
from modt.types import NONE, Bool, Float64, Proposals, Tracks
from tests.classification.scenes import blobs, seen

PAPER = FusionConfig(
    prior=(0.25, 0.25, 0.25),
    start_frame=1,
    view_weight=1.0,
    reopen_ratio=None,
    bearing_deg=20.0,
    range_ratio=0.2,
    extent_ratio=0.3,
    box_weight=0.0,
    slip=0.0,
)
ALL = (EveryFrame(), FirstView(FusionConfig()), KeyViews(FusionConfig()), KeyViews(PAPER))


def scene(counts: tuple[int, ...] = (50, 50)) -> tuple[Proposals, Tracks]:
    _, proposals = blobs(list(counts), np.random.default_rng(3))
    return proposals, seen(proposals)


def moved(proposals: Proposals, **columns: np.ndarray) -> Proposals:
    return dataclasses.replace(proposals, **columns)


@pytest.mark.parametrize("fusion", ALL)
@given(
    views=st.lists(
        arrays(np.float64, (2, 4), elements=st.floats(allow_nan=True, allow_infinity=True)), min_size=1, max_size=8
    )
)
def test_whatever_the_network_says_the_posterior_stays_one(fusion: Fusion, views: list[Float64]) -> None:
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
def test_key_views_multiply_as_equation_6_says(views: Float64, prior: Float64) -> None:
    views = views / views.sum(axis=1, keepdims=True)
    config = dataclasses.replace(PAPER, prior=(prior[0], prior[1], prior[2]), threshold=1.0)
    proposals, tracks = scene((50,))
    fusion = KeyViews(config)
    full = np.append(1 - prior.sum(), prior)
    expected = full.copy()
    for view in views:
        fusion.fuse(tracks, proposals, np.array([0]), view[None])
        expected = expected * view / full  # slow reference: P(X) times each P(X|Y) / P(X)
        expected /= expected.sum()
        if expected.min() < 1e-3:
            return  # the floor has a word from here on
        np.testing.assert_allclose(tracks.posterior[0], expected, rtol=1e-6)
    assert tracks.views[0] == len(views)


def test_no_class_is_ruled_out_for_good() -> None:
    proposals, tracks = scene((50,))
    fusion = KeyViews(PAPER)
    for _ in range(50):
        fusion.fuse(tracks, proposals, np.array([0]), np.array([[1.0, 0.0, 0.0, 0.0]]))
    for _ in range(3):
        fusion.fuse(tracks, proposals, np.array([0]), np.array([[0.01, 0.97, 0.01, 0.01]]))
    assert tracks.posterior[0].argmax() == 1


def test_every_frame_asks_for_whatever_is_seen() -> None:
    proposals, tracks = scene()
    tracks.final[:] = True
    tracks.proposal[1] = NONE
    assert EveryFrame().asks(tracks, proposals, np.zeros(2, np.bool_)).tolist() == [True, False]


def test_first_view_is_final() -> None:
    proposals, tracks = scene()
    fusion = FirstView(FusionConfig(once_from=3))
    asking, tracks.hits[:] = np.array([True, True]), 3
    assert fusion.asks(tracks, proposals, asking).all()
    certain = fusion.fuse(tracks, proposals, np.array([0]), np.array([[0.4, 0.3, 0.2, 0.1]]))
    assert certain.all()
    assert fusion.asks(tracks, proposals, asking).tolist() == [False, True]
    tracks.hits[1] = 2  # it may be a flicker
    assert not fusion.asks(tracks, proposals, asking).any()


def test_a_distinct_first_view_settles_the_class_at_once() -> None:
    proposals, tracks = scene()
    fusion = KeyViews(FusionConfig())
    view = np.array([[0.98, 0.01, 0.005, 0.005], [0.5, 0.3, 0.1, 0.1]])
    assert fusion.fuse(tracks, proposals, np.arange(2), view).tolist() == [True, False]
    assert tracks.final.tolist() == [True, False]
    assert tracks.views.tolist() == [1, 0]


def test_an_early_view_is_forgotten_at_the_starting_frame() -> None:
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


def test_a_class_settled_from_afar_is_looked_at_again_from_near() -> None:
    _, proposals = blobs([10, 10, 100], np.random.default_rng(0))
    tracks = seen(proposals)
    config = FusionConfig(reopen_ratio=4.0, reopen_points=60)
    fusion = KeyViews(config)
    sure = np.tile([0.99, 0.005, 0.0025, 0.0025], (3, 1))
    assert fusion.fuse(tracks, proposals, np.arange(3), sure).all()
    tracks.proposal[1] = NONE
    near = moved(proposals, offsets=np.array([0, 50, 100, 600]))
    settled = np.zeros(3, np.bool_)
    assert fusion.asks(tracks, near, settled).tolist() == [True, False, False]
    doubt = np.array([[0.3, 0.5, 0.1, 0.1]])
    assert not fusion.fuse(tracks, near, np.array([0]), doubt).any()
    prior = np.append(1 - sum(config.prior), config.prior)
    expected = (sure[0] / prior) ** (10 / 50) * doubt[0]  # what was known counts by its share of the points
    np.testing.assert_allclose(tracks.posterior[0], expected / expected.sum(), rtol=1e-6)
    nearer = moved(proposals, offsets=np.array([0, 200, 210, 310]))
    tracks.age[:] = 9
    assert fusion.asks(tracks, nearer, settled)[0]
    tracks.final[0] = True
    never = KeyViews(FusionConfig(reopen_ratio=None))
    assert not never.asks(tracks, near, settled).any()


def test_a_further_view_counts_by_its_weight() -> None:
    views = np.array([[0.4, 0.3, 0.2, 0.1], [0.1, 0.6, 0.2, 0.1]])
    posterior = []
    for weight in (0.0, 0.5, 1.0):
        proposals, tracks = scene((50,))
        fusion = KeyViews(dataclasses.replace(PAPER, view_weight=weight))
        for view in views:
            fusion.fuse(tracks, proposals, np.array([0]), view[None])
        posterior.append(tracks.posterior[0, 1])
    assert posterior[0] == pytest.approx(0.3)
    assert posterior[0] < posterior[1] < posterior[2]


def after_a_view(config: FusionConfig) -> tuple[KeyViews, Proposals, Tracks]:
    proposals, tracks = scene((50,))
    fusion = KeyViews(config)
    fusion.fuse(tracks, proposals, np.array([0]), np.array([[0.2, 0.6, 0.1, 0.1]]))
    tracks.age[:] = config.start_frame
    return fusion, proposals, tracks


def asks(fusion: KeyViews, tracks: Tracks, proposals: Proposals) -> bool:
    tracks.box = proposals.box.copy()
    return bool(fusion.asks(tracks, proposals, np.array([True]))[0])


def test_the_same_view_is_no_new_observation() -> None:
    fusion, proposals, tracks = after_a_view(PAPER)
    assert not asks(fusion, tracks, proposals)


@pytest.mark.parametrize(("points", "independent"), [(50, False), (59, False), (62, True), (38, True)])
def test_a_change_of_points_beyond_alpha_is_one(points: int, independent: bool) -> None:
    fusion, proposals, tracks = after_a_view(PAPER)
    assert asks(fusion, tracks, moved(proposals, offsets=np.array([0, points]))) == independent


def test_alpha_is_that_of_the_likeliest_class() -> None:
    config = dataclasses.replace(PAPER, alpha=(0.9, 0.1, 0.9))
    fusion, proposals, tracks = after_a_view(config)
    more = moved(proposals, offsets=np.array([0, 60]))
    assert not asks(fusion, tracks, more)
    tracks.key_posterior[0] = [0.2, 0.2, 0.5, 0.1]
    assert asks(fusion, tracks, more)


@pytest.mark.parametrize(("degrees", "independent"), [(10, False), (30, True), (-30, True), (355, False)])
def test_a_change_of_bearing_is_one(degrees: float, independent: bool) -> None:
    fusion, proposals, tracks = after_a_view(PAPER)
    box = proposals.box.copy()
    angle = np.deg2rad(degrees)
    c, s = np.cos(angle), np.sin(angle)
    box[:, :2] = box[:, :2] @ np.array([[c, s], [-s, c]])
    assert asks(fusion, tracks, moved(proposals, box=box)) == independent


def test_a_turning_sensor_does_not_change_the_view() -> None:
    fusion, proposals, tracks = after_a_view(PAPER)
    box = proposals.box.copy()
    angle = np.deg2rad(60)
    c, s = np.cos(angle), np.sin(angle)
    box[:, :2] = box[:, :2] @ np.array([[c, s], [-s, c]])
    box[:, 6] += angle  # the object turns with its bearing in the sensor frame, and stays put in the world
    assert not fusion.asks(tracks, moved(proposals, box=box), np.array([True]))[0]


@pytest.mark.parametrize(("factor", "independent"), [(1.1, False), (1.3, True), (0.7, True)])
def test_a_change_of_range_is_one(factor: float, independent: bool) -> None:
    fusion, proposals, tracks = after_a_view(PAPER)
    box = proposals.box * ([factor] * 2 + [1.0] * 5)
    assert asks(fusion, tracks, moved(proposals, box=box)) == independent


@pytest.mark.parametrize(("factor", "independent"), [(1.2, False), (1.5, True), (0.5, True)])
def test_a_change_of_extent_is_one(factor: float, independent: bool) -> None:
    fusion, proposals, tracks = after_a_view(PAPER)
    box = proposals.box * np.array([1, 1, 1, 1, 1, factor, 1])
    assert asks(fusion, tracks, moved(proposals, box=box)) == independent


@pytest.mark.parametrize("fusion", ALL)
def test_no_tracks_are_no_trouble(fusion: Fusion) -> None:
    proposals = Proposals.empty()
    tracks = seen(proposals)
    assert len(fusion.asks(tracks, proposals, np.zeros(0, np.bool_))) == 0
    assert len(fusion.fuse(tracks, proposals, np.zeros(0, np.int64), np.zeros((0, 4)))) == 0


class Told:
    """A prior that says what a test tells it."""

    def __init__(self, *rows: list[float], share: float = 0.0) -> None:
        self.rows = np.array(rows)
        self.share = share

    def of(self, proposals: Proposals) -> Float64:
        return self.rows

    def likely(self, said: Float64, least: float) -> Bool:
        return at_least(said, least)


WALL, DOUBTFUL, CAR = [0.999, 0.001 / 3, 0.001 / 3, 0.001 / 3], [0.95, 0.03, 0.01, 0.01], [0.2, 0.6, 0.1, 0.1]


@pytest.mark.parametrize(
    ("fusion", "asked"),
    [
        (KeyViews(FusionConfig(), Told(WALL, DOUBTFUL, CAR)), [False, True, True]),
        (FirstView(FusionConfig(), Told(WALL, DOUBTFUL, CAR)), [False, False, True]),  # its only view can wait
    ],
)
def test_before_it_is_classified_a_track_is_what_its_box_makes_it(
    fusion: KeyViews | FirstView, asked: list[bool]
) -> None:
    proposals, tracks = scene((50, 50, 50))
    tracks.hits[:] = 1
    assert fusion.asks(tracks, proposals, np.ones(3, np.bool_)).tolist() == asked
    np.testing.assert_allclose(tracks.posterior, [WALL, DOUBTFUL, CAR])
    assert not tracks.viewed.any()


def test_what_by_its_box_is_no_object_is_not_doubted() -> None:
    proposals, tracks = scene((20, 20))
    prior = Told(CAR, CAR)
    fusion = KeyViews(FusionConfig(reopen_ratio=2.0), prior)
    fusion.asks(tracks, proposals, np.ones(2, np.bool_))
    assert fusion.fuse(tracks, proposals, np.arange(2), np.array([[0.991, 0.003, 0.003, 0.003]] * 2)).all()
    prior.rows = np.array([WALL, CAR])
    nearer = moved(proposals, offsets=np.array([0, 100, 200]))
    assert fusion.asks(tracks, nearer, np.zeros(2, np.bool_)).tolist() == [False, True]


def test_a_class_goes_with_what_the_box_says_since_the_view() -> None:
    proposals, tracks = scene((50,))
    prior = Told(DOUBTFUL)
    fusion, view = KeyViews(FusionConfig(box_weight=1.0, slip=0.0), prior), np.array([[0.5, 0.3, 0.1, 0.1]])
    asking = np.array([True])
    fusion.asks(tracks, proposals, asking)
    fusion.fuse(tracks, proposals, np.array([0]), view)
    prior.rows = np.array([CAR])
    fusion.asks(tracks, proposals, asking)
    expected = view[0] * np.array(CAR) / np.array(DOUBTFUL)
    np.testing.assert_allclose(tracks.posterior[0], expected / expected.sum(), rtol=1e-6)
    prior.rows = np.array([DOUBTFUL])
    fusion.asks(tracks, proposals, asking)
    np.testing.assert_allclose(tracks.posterior[0], view[0], rtol=1e-6)


def test_a_proposal_may_be_something_else_than_its_track() -> None:
    proposals, tracks = scene((50, 50))
    prior = Told(CAR, CAR)
    fusion = KeyViews(FusionConfig(slip=0.2), prior)
    fusion.asks(tracks, proposals, np.ones(2, np.bool_))
    view = np.array([[0.001, 0.997, 0.001, 0.001]] * 2)
    assert fusion.fuse(tracks, proposals, np.arange(2), view).all()
    np.testing.assert_allclose(tracks.posterior, view, rtol=1e-6)  # who was looked at is what was seen
    fusion.asks(tracks, proposals, np.zeros(2, np.bool_))
    np.testing.assert_allclose(tracks.posterior, 0.8 * view + 0.2 * np.array(CAR), rtol=1e-6)


@pytest.mark.parametrize("make", [FirstView, KeyViews])
def test_a_settled_class_stays_and_how_sure_it_is_goes_with_the_box(make: type[FirstView | KeyViews]) -> None:
    proposals, tracks = scene((50,))
    prior = Told(CAR)
    fusion, unasked = make(FusionConfig(box_weight=1.0), prior), np.array([False])
    fusion.asks(tracks, proposals, np.array([True]))
    assert fusion.fuse(tracks, proposals, np.array([0]), np.array([[0.04, 0.92, 0.02, 0.02]])).all()
    prior.rows = np.array([WALL])
    assert not fusion.asks(tracks, proposals, unasked).any()
    assert tracks.posterior[0].argmax() == ObjectClass.BACKGROUND
    assert tracks.object_class.tolist() == [ObjectClass.CAR]
    tracks.final[:] = False
    assert tracks.object_class.tolist() == [ObjectClass.BACKGROUND]


def test_a_further_view_takes_the_place_of_what_the_box_said_since_the_last() -> None:
    views = np.array([[0.5, 0.3, 0.1, 0.1], [0.4, 0.4, 0.1, 0.1]])
    fused = []
    for between in (DOUBTFUL, CAR):
        proposals, tracks = scene((50,))
        prior = Told(DOUBTFUL)
        fusion = KeyViews(dataclasses.replace(PAPER, box_weight=1.0), prior)
        for said, view in zip((DOUBTFUL, between), views, strict=True):
            prior.rows = np.array([said])
            fusion.asks(tracks, proposals, np.array([True]))
            fusion.fuse(tracks, proposals, np.array([0]), view[None])
        fused.append(tracks.posterior[0].copy())
    np.testing.assert_allclose(fused[0], fused[1])


@pytest.mark.parametrize("share", [0.0, 0.4])
def test_a_further_view_that_says_what_is_known_without_it_adds_nothing(share: float) -> None:
    proposals, tracks = scene((50,))
    config = dataclasses.replace(PAPER, prior=(0.08, 0.02, 0.02))
    fusion, row = KeyViews(config, Told(DOUBTFUL, share=share)), np.array([0])
    fusion.asks(tracks, proposals, np.array([True]))
    first = np.array([[0.5, 0.3, 0.1, 0.1]])
    fusion.fuse(tracks, proposals, row, first)
    known = np.array([0.88, 0.08, 0.02, 0.02]) ** (1 - share) * np.array(DOUBTFUL) ** share
    fusion.fuse(tracks, proposals, row, known[None] / known.sum())
    np.testing.assert_allclose(tracks.posterior, first, rtol=1e-6)
    assert tracks.views.tolist() == [2]


def test_what_took_its_class_over_is_looked_at_where_its_box_may_be_an_objects() -> None:
    proposals, tracks = scene((50, 50))
    tracks.final[:] = True
    tracks.posterior[:] = [1.0, 0.0, 0.0, 0.0]
    settled = np.zeros(2, np.bool_)
    assert KeyViews(FusionConfig(), Told(WALL, CAR)).asks(tracks, proposals, settled).tolist() == [False, True]
    assert tracks.posterior[:, 0].tolist() == [1.0, 1.0]  # until it is classified, the class taken over stands
    assert not FirstView(FusionConfig(), Told(WALL, CAR)).asks(tracks, proposals, settled).any()
