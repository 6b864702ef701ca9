"""The sweep of the fusion's parameters, on drives that are made up and on a rendered one."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable

import numpy as np
import pytest

from modt import profile
from modt.classes import ObjectClass
from modt.classification.fusion import EveryFrame, FirstView, KeyViews
from modt.classification.prior import FrequencyPrior, Prior
from modt.config import FusionConfig
from modt.geometry import FieldOfView
from modt.pipeline import Fusion
from modt.types import NONE, Proposals
from tests.classification.scenes import blobs
from tools.study import sweep_fusion
from tools.study.recording import Moment, Recording, owners, record
from tools.study.replayed import CALLS, Outcome, replay
from tools.study.sweep_fusion import Setting, Tried
from tools.train.labelled_scans import TEST_DRIVE, Scan
from tools.train.synthetic_scans import scan_of

ASK_FROM = 2
ALONE = FusionConfig(extent_change=10.0, review_point_ratio=None)
"""The number of points alone makes a view independent, and nothing is doubted."""


@pytest.fixture(scope="module")
def played() -> Recording:
    """Ten frames of six tracks that come nearer; the network is never sure and mostly right."""
    rng = np.random.default_rng(3)
    kind = np.array([0, 0, 0, 1, 2, 3])
    moments = []
    for k in range(10):
        _, proposals = blobs([int(10 * 1.3**k) + 5] * 6, rng)
        likelihood = rng.uniform(0.8, 1.0, (6, 4))
        likelihood[np.arange(6), kind] += 0.3
        likelihood /= likelihood.sum(axis=1, keepdims=True)
        shown = proposals.box.copy()
        moments.append(
            Moment(proposals, shown, np.arange(6), np.full((6, 4), 0.25), likelihood, kind, np.ones(6, np.bool_))
        )
    return Recording("played", tuple(moments), 6)


def calls(outcome: Outcome) -> int:
    return sum(outcome.calls.values())


def keyed(config: FusionConfig) -> Callable[[Prior], Fusion]:
    return lambda prior: KeyViews(config, prior)


def test_conventional_classifies_whatever_it_sees(played: Recording) -> None:
    outcome = replay([played, played], lambda prior: EveryFrame(), ASK_FROM)
    assert outcome.share == 1.0
    assert calls(outcome) == 2 * played.n_proposals == 120
    assert len(outcome.each) == 2


def test_efficient_classifies_each_track_once(played: Recording) -> None:
    outcome = replay([played], lambda prior: FirstView(FusionConfig(), prior), ASK_FROM)
    assert outcome.calls == dict(zip(CALLS, (6, 0, 0, 0), strict=True))


def test_without_an_independent_view_none_is_taken_after_the_first(played: Recording) -> None:
    never = dataclasses.replace(
        ALONE, point_change=(10.0,) * 4, start_frame=1, object_threshold=1.0, background_threshold=1.0
    )
    few = replay([played], keyed(never), ASK_FROM)
    assert few.calls == dict(zip(CALLS, (6, 0, 0, 0), strict=True))
    always = dataclasses.replace(never, point_change=(0.0,) * 4)
    many = replay([played], keyed(always), ASK_FROM)
    assert many.calls == dict(zip(CALLS, (6, 0, 48, 0), strict=True))  # each of the nine frames that may ask


def test_a_late_start_replaces_the_first_view(played: Recording) -> None:
    late = dataclasses.replace(
        ALONE, point_change=(10.0,) * 4, start_frame=5, object_threshold=1.0, background_threshold=1.0
    )
    assert replay([played], keyed(late), ASK_FROM).calls == dict(zip(CALLS, (6, 6, 0, 0), strict=True))


def test_what_is_settled_from_few_points_is_doubted(played: Recording) -> None:
    settled = dataclasses.replace(
        ALONE, object_threshold=0.25, background_threshold=0.25, prior=(0.25,) * 3, review_point_ratio=2.0
    )
    outcome = replay([played], keyed(settled), ASK_FROM)
    assert outcome.calls["first views"] == 6
    assert outcome.calls["doubts"] == 6 * 2  # 18 points at first, then 42 and 86: each more than twice the last
    assert calls(outcome) == 18


def test_replays_repeat_themselves_and_leave_the_recording_alone(played: Recording) -> None:
    before = [moment.likelihood.tobytes() for moment in played.moments]
    once, again = (replay([played], keyed(FusionConfig()), ASK_FROM) for _ in range(2))
    assert once == again
    assert before == [moment.likelihood.tobytes() for moment in played.moments]


def test_what_was_never_asked_counts_as_missed(played: Recording) -> None:
    late = replay([played], lambda prior: FirstView(FusionConfig(), prior), ask_from=6, judged_from=1)
    assert max(late.precision.values()) <= 0.5 + 0.3  # five of ten views come before the first answer
    assert min(replay([played], lambda prior: FirstView(FusionConfig(), prior), ask_from=6).precision.values()) > max(
        late.precision.values()
    )


def test_only_large_proposals_are_judged_on_request(played: Recording) -> None:
    counts = [int(moment.judged.sum()) for moment in played.judged_from(60).moments]
    assert counts == [0] * 7 + [6] * 3


def test_the_ideal_tracker_follows_the_largest_piece_of_an_object() -> None:
    box, none, points = np.zeros((4, 7)), np.zeros(4, np.bool_), np.zeros((40, 4), np.float32)
    offsets = np.array([0, 10, 30, 35, 40])
    proposals = Proposals(np.arange(40), offsets, points[:, :3].T, np.zeros((4, 3)), box, none)
    car, rider = np.arange(2, 28), np.arange(36, 40)  # pieces of 8 and of 18 points; 4 of 5 points
    kinds = (ObjectClass.CAR, ObjectClass.CYCLIST)
    unlabelled = np.zeros(40, np.bool_)
    scan = Scan("s", "d", points, (car, rider), kinds, np.zeros((2, 7)), FieldOfView(), unlabelled, (70, 8))
    assert owners(scan, proposals).tolist() == [NONE, 70, NONE, 8]


def test_a_drive_is_recorded_with_one_track_a_body() -> None:
    from modt.classification.pointnet import PointNet
    from modt.sources.synthetic_stream import SyntheticStream

    config = profile.load()
    network = PointNet(config.classification, config.sensor)
    sweeps = list(SyntheticStream("crossing", "hdl-64e", 0.4, 7).sweeps())
    drive = [(frame, scan_of(frame, truth, "x", "x", camera=True)) for frame, truth in sweeps]
    recording = record("x", drive, config, network, FrequencyPrior(config.fusion.prior))
    assert len(recording.moments) == 4
    bodies: dict[int, set[int]] = {}
    for moment, (frame, scan) in zip(recording.moments, drive, strict=True):
        assert len(np.unique(moment.track)) == len(moment.track)
        np.testing.assert_allclose(moment.likelihood.sum(axis=1), 1.0, atol=1e-5)
        for body, track in zip(owners(scan, moment.proposals).tolist(), moment.track.tolist(), strict=True):
            if body != NONE:
                bodies.setdefault(body, set()).add(track)
        again = network.classify(frame.points, moment.proposals, np.arange(len(moment.proposals)))
        assert again.tobytes() == moment.likelihood.tobytes()
    assert bodies
    assert all(len(tracks) == 1 for tracks in bodies.values())
    assert replay([recording], lambda prior: EveryFrame(), 1).share == 1.0
    own = record("x", drive, config, network, FrequencyPrior(config.fusion.prior), ideal=False)
    for moment, ideal in zip(own.moments, recording.moments, strict=True):
        assert len(np.unique(moment.track)) == len(moment.track)
        assert (moment.judged | ~ideal.judged).all()
    assert sum(int(m.judged.sum()) for m in own.moments) > sum(int(m.judged.sum()) for m in recording.moments)


def test_each_sweep_holds_the_default_once_where_its_values_do() -> None:
    config = FusionConfig()
    settings = list(sweep_fusion.sweeps(config))
    starred = [s.sweep for s in settings if s.value.endswith("*")]
    assert len(starred) == len(set(starred))
    assert set(starred) == {s.sweep for s in settings} - {"review_point_ratio, review_max_points"}


def tried(mean: float, share: float, checked: tuple[float, float] | None = None) -> Tried:
    found, *check = (
        Outcome({"car": value}, dict.fromkeys(CALLS, 1), part, (value,))
        for value, part in ((mean, share), *([checked] if checked else []))
    )
    return Tried(Setting("sweep", "value", lambda prior: EveryFrame()), found, check[0] if check else None)


def test_the_front_holds_what_nothing_cheaper_equals() -> None:
    results = [tried(0.9, 1.0), tried(0.5, 0.1), tried(0.4, 0.2), tried(0.9, 0.3)]
    assert [(r.found.share, r.found.mean) for r in sweep_fusion.front(results)] == [(0.1, 0.5), (0.3, 0.9)]


def test_better_means_on_both_sets_and_for_no_more_calls() -> None:
    default = tried(0.8, 0.1, (0.8, 0.1))
    good = tried(0.9, 0.1, (0.81, 0.1))
    results = [good, tried(0.9, 0.1, (0.8, 0.1)), tried(0.9, 0.11, (0.9, 0.1)), tried(0.9, 0.1, (0.9, 0.2)), default]
    assert sweep_fusion.better(results, default) == [good]


def test_the_report_names_every_sweep_and_fits_between_the_marks() -> None:
    default = tried(0.8, 0.1, (0.8, 0.1))
    short, whole = sweep_fusion.report([default], [default], "about")
    assert sweep_fusion.NO_BETTER in short
    assert "| 80.0" in whole
    text = f"a\n{sweep_fusion.BEGIN}old\n{sweep_fusion.END}\nb\n"
    once = sweep_fusion.renewed(text, short)
    assert once.startswith("a\n")
    assert once.endswith("\nb\n")
    assert "old" not in once
    assert sweep_fusion.renewed(once, short) == once
    assert "<svg" in sweep_fusion.drawn([default, tried(0.9, 0.2, (0.9, 0.2))], "title", "about")


def test_the_test_drive_is_refused(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys, "argv", ["sweep_fusion.py", "--drive", f"nowhere/{TEST_DRIVE}"])
    with pytest.raises(SystemExit):
        sweep_fusion.main()
    assert "--confirm" in capsys.readouterr().err
