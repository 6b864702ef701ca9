"""Replay of a fusion over recordings."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

from modt.classification.fusion import EveryFrame, KeyViews, OneView
from modt.classification.prior import Prior
from modt.config import FusionConfig
from modt.pipeline import Fusion
from tests.classification.scenes import blobs
from tools.study.fusion_replay import CALLS, Outcome, replay
from tools.study.recording import RecordedFrame, Recording

MIN_HITS = 2
ALONE = FusionConfig(extent_change=10.0, review_point_ratio=None)
"""Views independent by their number of points alone; no review."""


@pytest.fixture(scope="module")
def played() -> Recording:
    """Ten frames of six approaching tracks; the network is mostly correct, at low confidence."""
    rng = np.random.default_rng(3)
    kind = np.array([0, 0, 0, 1, 2, 3])
    frames = []
    for k in range(10):
        _, proposals = blobs([int(10 * 1.3**k) + 5] * 6, rng)
        likelihood = rng.uniform(0.8, 1.0, (6, 4))
        likelihood[np.arange(6), kind] += 0.3
        likelihood /= likelihood.sum(axis=1, keepdims=True)
        box, uniform, scored = proposals.box.copy(), np.full((6, 4), 0.25), np.ones(6, np.bool_)
        frames.append(RecordedFrame(proposals, box, np.arange(6), uniform, likelihood, kind, scored))
    return Recording("played", tuple(frames), 6)


def calls(outcome: Outcome) -> int:
    return sum(outcome.calls.values())


def keyed(config: FusionConfig) -> Callable[[Prior], Fusion]:
    return lambda prior: KeyViews(config, prior)


def test_conventional_classifies_every_proposal(played: Recording) -> None:
    outcome = replay([played, played], lambda prior: EveryFrame(), MIN_HITS)
    assert outcome.share == 1.0
    assert calls(outcome) == 2 * played.n_proposals == 120
    assert len(outcome.each) == 2


def test_efficient_classifies_each_track_once(played: Recording) -> None:
    once = FusionConfig(review_point_ratio=None)
    outcome = replay([played], lambda prior: OneView(once, prior), MIN_HITS)
    assert outcome.calls == dict(zip(CALLS, (6, 0, 0, 0), strict=True))


def test_only_independent_views_are_fused_after_the_first(played: Recording) -> None:
    never = dataclasses.replace(
        ALONE, point_change=(10.0,) * 4, start_frame=1, object_threshold=1.0, background_threshold=1.0
    )
    few = replay([played], keyed(never), MIN_HITS)
    assert few.calls == dict(zip(CALLS, (6, 0, 0, 0), strict=True))
    always = dataclasses.replace(never, point_change=(0.0,) * 4)
    many = replay([played], keyed(always), MIN_HITS)
    assert many.calls == dict(zip(CALLS, (6, 0, 48, 0), strict=True))  # each of the nine frames that may ask


def test_a_late_start_replaces_the_first_view(played: Recording) -> None:
    late = dataclasses.replace(
        ALONE, point_change=(10.0,) * 4, start_frame=5, object_threshold=1.0, background_threshold=1.0
    )
    assert replay([played], keyed(late), MIN_HITS).calls == dict(zip(CALLS, (6, 6, 0, 0), strict=True))


def test_a_class_final_with_few_points_is_reviewed(played: Recording) -> None:
    settled = dataclasses.replace(
        ALONE, object_threshold=0.25, background_threshold=0.25, prior=(0.25,) * 3, review_point_ratio=2.0
    )
    outcome = replay([played], keyed(settled), MIN_HITS)
    assert outcome.calls["first views"] == 6
    assert outcome.calls["reviews"] == 6 * 2  # 18 points at first, then 42 and 86: each more than twice the last
    assert calls(outcome) == 18


def test_replays_are_reproducible_and_leave_the_recording_unchanged(played: Recording) -> None:
    before = [recorded.likelihood.tobytes() for recorded in played.frames]
    once, again = (replay([played], keyed(FusionConfig()), MIN_HITS) for _ in range(2))
    assert once == again
    assert before == [recorded.likelihood.tobytes() for recorded in played.frames]


def test_unclassified_proposals_count_as_missed(played: Recording) -> None:
    late = replay([played], lambda prior: OneView(FusionConfig(), prior), min_hits=6, scored_from=1)
    assert max(late.precision.values()) <= 0.5 + 0.3  # five of ten views come before the first answer
    assert min(replay([played], lambda prior: OneView(FusionConfig(), prior), min_hits=6).precision.values()) > max(
        late.precision.values()
    )


def test_small_proposals_can_be_left_out_of_the_score(played: Recording) -> None:
    counts = [int(recorded.scored.sum()) for recorded in played.scored_from(60).frames]
    assert counts == [0] * 7 + [6] * 3
