"""Selection and fusion of views, boxes and motion."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose, assert_array_equal

from modt.classes import ObjectClass
from modt.classification.fusion import EveryFrame, FirstViews, FurtherViews, FusedTracks
from modt.classification.motion_likelihood import MotionLikelihood
from modt.classification.prior import FrequencyPrior
from modt.classification.product_fusion import AnyView, KeyViews
from modt.classification.tuning import ClassificationTuning
from modt.config import FusionConfig
from modt.types import NONE, Cut, MotionState
from tests.classification.scenes import ROW, Fused, with_points

CONFIG = FusionConfig()
WEIGHTS = ClassificationTuning().fusion.evidence
FREQUENCY = np.array([0.88, 0.08, 0.02, 0.02])
ALIKE = FrequencyPrior(FREQUENCY)
ALL = (EveryFrame(), *(mode(CONFIG, ALIKE) for mode in (FirstViews, FurtherViews, AnyView, KeyViews)))
WALL = [0.999, 0.001 / 3, 0.001 / 3, 0.001 / 3]
UNLIKELY = [0.95, 0.03, 0.01, 0.01]
CAR = [0.2, 0.6, 0.1, 0.1]
DOUBTFUL = [0.4, 0.2, 0.2, 0.2]
LIKE_ANY = [0.8, 0.1, 0.05, 0.05]
SURELY_BACKGROUND = [0.997, 0.001, 0.001, 0.001]
CLEARLY_A_CAR = [0.001, 0.997, 0.001, 0.001]
PERHAPS_A_CAR = [0.75, 0.23, 0.01, 0.01]
PERHAPS_A_PERSON = [0.88, 0.01, 0.1, 0.01]


class FixedPrior:
    """Prior given by a test."""

    frequency = FREQUENCY

    def __init__(self, *rows, pool_weight=0.0):
        self.rows = np.array(rows)
        self._pool_weight = pool_weight

    def pool_weight(self, proposals):
        return self._pool_weight

    def probability(self, proposals):
        return self.rows

    def may_be_object(self, probability, threshold):
        return 1.0 - probability[:, 0] >= threshold


@pytest.mark.parametrize("fusion", ALL)
@given(st.lists(arrays(np.float64, 4, elements=st.floats(allow_nan=True, allow_infinity=True)), max_size=8))
@settings(max_examples=40)
def test_posterior_stays_a_distribution_for_any_likelihood(fusion, views):
    subject = Fused(fusion, 50, 50, frames=3)
    for view in views:
        subject.asks()
        subject.fuse(*view, rows=np.arange(2))
        subject.tracks.age[:] += 1
        assert (subject.tracks.posterior > 0).all()
        assert_allclose(subject.tracks.posterior.sum(axis=1), 1.0)


def test_every_frame_requests_all_tracks_with_a_proposal():
    subject = Fused(EveryFrame(), 50, 50)
    subject.tracks.final[:] = True
    subject.tracks.proposal[1] = NONE
    assert subject.asks(False) == [True, False]


@pytest.mark.parametrize(
    ("x", "length_m", "height_m", "asked"),
    [(2.5, 0.6, 1.7, True), (3.5, 0.6, 1.7, False), (2.5, 1.5, 1.7, False), (2.5, 0.6, 0.6, False)],
)
def test_a_possible_person_near_by_is_classified_whatever_its_box_says(x, length_m, height_m, asked):
    subject = Fused(FurtherViews(CONFIG, FixedPrior(WALL, WALL)), 15, 15, frames=3)
    subject.proposals.box[:, :6] = [x, 0.0, 0.0, length_m, 0.4, height_m]
    assert subject.asks() == [asked] * 2


@pytest.mark.parametrize(
    ("x", "points", "frames", "asked"),
    [(14.0, 20, 2, True), (16.0, 20, 2, False), (14.0, 19, 2, False), (14.0, 20, 1, False)],
)
def test_what_shows_enough_points_nearby_gets_one_view_whatever_its_box_says(x, points, frames, asked):
    subject = Fused(FurtherViews(CONFIG, FixedPrior(WALL, WALL)), points, points, frames=frames)
    subject.proposals.box[:, :6] = [x, 0.0, 0.0, 3.0, 0.4, 0.5]
    assert subject.asks() == [asked] * 2


@pytest.mark.parametrize(
    ("x", "length_m", "cut", "is_less"),
    [
        (3.0, 2.5, 0, True),
        (3.0, 1.9, 0, False),
        (3.0, 4.0, 0, False),
        (9.0, 2.5, 0, False),
        (3.0, 2.5, Cut.SIDE, False),
    ],
)
def test_a_near_thing_between_the_width_and_the_length_of_a_car_is_hardly_one(x, length_m, cut, is_less):
    subject = Fused(FusedTracks(CONFIG, FixedPrior(CAR)), 50)
    subject.proposals.box[:, :2] = x, 0.0
    subject.proposals.cut[:] = cut
    subject.tracks.size_m[:] = length_m, 1.0, 1.2
    subject.fusion.observe(subject.tracks, subject.tracks, subject.proposals)
    assert (subject.tracks.motion_evidence[0, ObjectClass.CAR] < -2.0) == is_less


@pytest.mark.parametrize("mode", [FirstViews, FurtherViews])
def test_a_hidden_person_is_not_asked_about_and_keeps_what_is_known_of_the_box(mode):
    subject = Fused(mode(CONFIG, FixedPrior(CAR, CAR)), 50, 50, frames=3)
    subject.tracks.top_cut[0] = True
    assert subject.asks() == [False, True]
    assert (subject.tracks.box_evidence[0] == 0).all()
    assert (subject.tracks.box_evidence[1] != 0).any()


@given(
    views=arrays(np.float64, (6, 4), elements=st.floats(0.05, 1.0)),
    boxes=arrays(np.float64, (6, 4), elements=st.floats(0.05, 1.0)),
    counts=arrays(np.int64, (6,), elements=st.integers(1, 400)),
    moved_m=st.floats(0, 20),
    pool_weight=st.sampled_from([0.0, 0.5]),
)
def test_posterior_is_that_of_the_plain_formula(views, boxes, counts, moved_m, pool_weight):
    """The slow reference: all views and boxes kept, and weighed anew in every frame."""
    views, boxes = (p / p.sum(axis=1, keepdims=True) for p in (views, boxes))
    prior = FixedPrior(boxes[0].tolist(), pool_weight=pool_weight)
    subject = Fused(FusedTracks(CONFIG, prior), 50)
    fusion = subject.fusion
    tracks = subject.tracks
    tracks.moved_m[:] = moved_m
    tracks.observed_s[:] = 3.0
    tracks.size_m[:] = 1.0
    motion = MotionLikelihood(ClassificationTuning().fusion.motion).log_ratio(
        tracks.moved_m, tracks.observed_s, tracks.size_m, np.zeros(len(tracks), np.bool_)
    )[:, 0]
    log_frequency = np.log(FREQUENCY / FREQUENCY.sum())
    seen = []
    box_mean = np.zeros(4)
    for k, (view, box, count) in enumerate(zip(views, boxes, counts.tolist(), strict=True)):
        now = with_points(subject.proposals, count)
        prior.rows = box[None]
        tracks.hits[:] = k + 1
        fusion.observe(tracks, tracks, now)
        fusion.fuse(tracks, tracks, now, ROW, view[None])
        odds = (1 / box[0] - 1) / (1 / FREQUENCY[0] - 1)  # of an object by the box, over those by frequency
        pooled = log_frequency + pool_weight * np.log(odds) * np.array([0, 1, 1, 1])
        seen = [(weight * WEIGHTS.view_memory, evidence) for weight, evidence in seen]
        seen.append((count**0.5, np.log(view) - pooled))
        gain = max(1 / (k + 1), 1 - WEIGHTS.box_memory)
        box_mean = (1 - gain) * box_mean + gain * (np.log(box) - log_frequency)
        mean = sum(weight * evidence for weight, evidence in seen) / sum(weight for weight, _ in seen)
        log = log_frequency + (k + 1) ** WEIGHTS.view_exponent * mean + WEIGHTS.box_weight * box_mean + motion
        expected = np.exp(log) / np.exp(log).sum()
        if expected.min() < 1e-3:
            return  # the floor applies from here on
        expected = (1 - WEIGHTS.mismatch_probability) * expected + WEIGHTS.mismatch_probability * box
        assert_allclose(tracks.posterior[0], expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("motion", "is_weaker"), [(MotionState.STILL, True), (MotionState.MOVING, False), (MotionState.UNKNOWN, False)]
)
def test_a_view_of_few_points_says_less_than_the_same_view_of_many_of_what_is_still(motion, is_weaker):
    posteriors = []
    for points in (5, 20, 40):
        subject = Fused(FurtherViews(CONFIG, ALIKE), points)
        subject.tracks.motion[:] = motion
        subject.fuse(*CLEARLY_A_CAR)
        posteriors.append(subject.tracks.posterior[0, 1])
    assert posteriors[1] == posteriors[2]
    assert (posteriors[0] < posteriors[1]) == is_weaker


@pytest.mark.parametrize("make", [FurtherViews, FirstViews])
def test_what_is_hardly_an_object_is_not_classified(make):
    """Mode accurate does classify a person by the box who stands still, if there are points enough to tell."""
    subject = Fused(make(CONFIG, FixedPrior(WALL, UNLIKELY, CAR, *[PERHAPS_A_PERSON] * 2)), *[50] * 4, 10, frames=3)
    subject.proposals.box[:, 0] = 20.0  # far enough for the box to decide
    subject.tracks.observed_s[3:] = 5.0
    subject.tracks.size_m[3:] = 0.6
    assert subject.asks() == [False, False, True, make is FurtherViews, False]
    assert not subject.tracks.viewed.any()
    assert subject.tracks.posterior[:2, 1].max() < 0.05 < 0.2 < subject.tracks.posterior[2, 1]


def test_efficient_asks_for_one_view_that_confirms_a_class():
    subject = Fused(FirstViews(CONFIG, FixedPrior(CAR, CAR)), 50, 50, frames=3)
    assert subject.asks() == [True, True]
    assert subject.fuse(*CLEARLY_A_CAR).all()
    assert subject.asks(~subject.tracks.final) == [False, True]
    subject.tracks.hits[1] = 1  # too few
    assert subject.asks(~subject.tracks.final) == [False, False]


@pytest.mark.parametrize("make", [FirstViews, FurtherViews])
def test_an_unconfirmed_track_is_classified_again_with_clearly_more_points(make):
    subject = Fused(make(CONFIG, FixedPrior(CAR)), 40, frames=3)
    subject.asks()
    assert not subject.fuse(*DOUBTFUL).any()
    for points in (55, 56):
        subject.tracks.points[:] = points
        assert subject.asks() == [points == 56]


@pytest.mark.parametrize(
    ("points", "box", "asked"),
    [(50, LIKE_ANY, False), (100, LIKE_ANY, False), (110, LIKE_ANY, True), (50, CAR, True)],
)
def test_confirmed_background_is_classified_again_for_many_points_or_another_box(points, box, asked):
    prior = FixedPrior(LIKE_ANY)
    subject = Fused(FurtherViews(CONFIG, prior), 50, frames=3)
    subject.asks()
    assert subject.fuse(*SURELY_BACKGROUND).all()
    prior.rows = np.array([box])
    subject.tracks.age[:] = 200
    subject.tracks.points[:] = points
    assert any(subject.asks(False)[0] for _ in range(5)) == asked


@pytest.mark.parametrize(
    ("box", "view", "least", "most"),
    [(CAR, CLEARLY_A_CAR, 4, 4), (CAR, PERHAPS_A_CAR, 8, 12), (LIKE_ANY, SURELY_BACKGROUND, 1, 1)],
)
def test_an_object_is_classified_again_at_growing_intervals_and_background_is_not(box, view, least, most):
    """An unconfirmed object is classified more often, with as many points all the while."""
    subject = Fused(FurtherViews(CONFIG, FixedPrior(box)), 50)
    asked = []
    for frame in range(1, 80):
        subject.tracks.age[:] = subject.tracks.hits[:] = frame
        if subject.asks(~subject.tracks.final)[0]:
            asked.append(frame)
            subject.fuse(*view)
    assert least <= len(asked) <= most
    assert (np.diff(asked, 2) >= 0).all()


@pytest.mark.parametrize("make", [FirstViews, FurtherViews])
@pytest.mark.parametrize(
    ("moved_m", "view", "person"), [(1.5, [0.75, 0.08, 0.15, 0.02], True), (0.0, LIKE_ANY, False)]
)
def test_a_possible_person_is_classified_again_within_four_frames(make, moved_m, view, person):
    subject = Fused(make(CONFIG, FixedPrior(FREQUENCY.tolist())), 12)
    asked = []
    tracks = subject.tracks
    tracks.size_m[:] = 0.6
    tracks.moved_m[:] = moved_m
    tracks.observed_s[:] = 3.0
    for frame in range(1, 60):
        tracks.age[:] = tracks.hits[:] = frame
        if subject.asks(~tracks.final)[0]:
            asked.append(frame)
            assert not subject.fuse(*view).any()
    waits = np.diff([*asked, frame])
    assert (waits.max() == 4) if person else (waits.max() > 10)


def test_lost_tracks_keep_their_posterior_and_ask_for_nothing():
    subject = Fused(FurtherViews(CONFIG, FixedPrior(CAR)), 50, frames=3)
    subject.asks()
    subject.fuse(*CLEARLY_A_CAR)
    before = subject.tracks.posterior.copy()
    subject.tracks.proposal[:] = NONE
    subject.tracks.age[:] = 100
    assert subject.asks() == [False]
    assert_array_equal(subject.tracks.posterior, before)


@pytest.mark.parametrize(("make", "confirmed"), [(FirstViews, False), (FurtherViews, True)])
def test_background_needs_to_be_as_likely_as_an_object_where_nobody_looks_again(make, confirmed):
    subject = Fused(make(CONFIG, FixedPrior(FREQUENCY.tolist())), 50, frames=3)
    subject.asks()
    assert subject.fuse(0.97, 0.02, 0.005, 0.005).tolist() == [confirmed]
