"""Sweep of the parameters of the fusion."""

from __future__ import annotations

import sys

import pytest

from modt.classification.fusion import EveryFrame
from modt.config import FusionConfig
from tools.study import sweep_fusion
from tools.study.fusion_replay import CALLS, Outcome
from tools.study.sweep_fusion import Setting, Trial
from tools.train.labelled_scans import TEST_DRIVE


def test_each_sweep_contains_the_default_at_most_once() -> None:
    config = FusionConfig()
    settings = list(sweep_fusion.sweeps(config))
    starred = [s.sweep for s in settings if s.value.endswith("*")]
    assert len(starred) == len(set(starred))
    assert set(starred) == {s.sweep for s in settings}


def trial(mean: float, share: float, checked: tuple[float, float] | None = None) -> Trial:
    found, *check = (
        Outcome({"car": value}, dict.fromkeys(CALLS, 1), part, (value,))
        for value, part in ((mean, share), *([checked] if checked else []))
    )
    return Trial(Setting("sweep", "value", lambda prior: EveryFrame()), found, check[0] if check else None)


def test_the_pareto_front_has_no_dominated_trial() -> None:
    results = [trial(0.9, 1.0), trial(0.5, 0.1), trial(0.4, 0.2), trial(0.9, 0.3)]
    assert [(r.found.share, r.found.mean) for r in sweep_fusion.pareto_front(results)] == [(0.1, 0.5), (0.3, 0.9)]


def test_improvements_hold_on_both_sets_with_no_more_calls() -> None:
    default = trial(0.8, 0.1, (0.8, 0.1))
    good = trial(0.9, 0.1, (0.81, 0.1))
    results = [good, trial(0.9, 0.1, (0.8, 0.1)), trial(0.9, 0.11, (0.9, 0.1)), trial(0.9, 0.1, (0.9, 0.2)), default]
    assert sweep_fusion.improvements(results, default) == [good]


def test_the_report_has_every_sweep_and_replaces_its_section() -> None:
    default = trial(0.8, 0.1, (0.8, 0.1))
    short, whole = sweep_fusion.report([default], [default], "about")
    assert sweep_fusion.NO_BETTER in short
    assert "| 80.0" in whole
    text = f"a\n{sweep_fusion.BEGIN}old\n{sweep_fusion.END}\nb\n"
    once = sweep_fusion.replace_section(text, short)
    assert once.startswith("a\n")
    assert once.endswith("\nb\n")
    assert "old" not in once
    assert sweep_fusion.replace_section(once, short) == once
    assert "<svg" in sweep_fusion.sweep_page([default, trial(0.9, 0.2, (0.9, 0.2))], "title", "about")


def test_the_test_drive_is_refused(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys, "argv", ["sweep_fusion.py", "--drive", f"nowhere/{TEST_DRIVE}"])
    with pytest.raises(SystemExit):
        sweep_fusion.main()
    assert "--confirm" in capsys.readouterr().err
