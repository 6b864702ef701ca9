"""The summary's figures from hand-made records."""

import re

import pytest

from modt.energy.ledger import StageWork
from modt.reporting.summary import COUNTED, Summary, around, summary_text
from tests.results import CAR, ledger_line, result, with_kinds

FRAMES = [
    result(0, [5, 5], {0: 1, 1: 2}, {1: CAR}, classified=2),
    result(1, [5, 5], {0: 1, 1: 2}, {1: CAR}, classified=0),
    result(2, [5, 5], {0: 1, 1: 3}, {1: CAR}, lost=(2,), classified=1),
    result(3, [5], {0: 1}, {1: CAR}),
]
# Track 1 is seen 4 times, 2 twice (lost frames do not count), 3 once.
for frame, hits in zip(FRAMES, ([1, 1], [2, 2], [3, 1, 2], [4]), strict=True):
    frame.tracks.hits[:] = hits
FRAMES[3].proposals.coordinates[:] = [[9.0, 9.0, 4.5, 9.0, 9.0], [0.0, 1.0, 6.0, 2.0, 3.0], [7.0] * 5]


def whole():
    summary = Summary()
    for r in FRAMES:
        summary.add_result(r)
        ns = (1 + r.frame.index) * 10**6
        stages = {"segmentation": StageWork(1, 2, 0, ns, ns), "classification": StageWork(1, 1, 0, 10**6, 10**6)}
        summary.add_ledger(ledger_line(r.frame.index, **stages))
    return summary.result()


def test_figures():
    figures = whole()
    assert (figures["frames"], figures["proposals"], figures["classifications"]) == (4, 7, 3)
    assert figures["beta"] == pytest.approx(3 / 7)
    assert figures["tracks"] == {"count": 3, "N_go": pytest.approx(7 / 3)}
    assert figures["foreground_tracks"] == {"count": 1, "N_go": 4.0}
    assert figures["energy_counts"] == {"E_seg": 4, "E_class": 4}
    assert figures["stages"]["segmentation"]["cpu_ms"]["mean"] == pytest.approx(2.5)
    assert figures["stages"]["segmentation"]["wall_ms"]["max"] == pytest.approx(4.0)


def test_empty_run_has_no_ratio():
    figures = Summary().result()
    assert figures["beta"] is None
    assert figures["tracks"] == {"count": 0, "N_go": None}
    assert "0 frames" in summary_text(figures)


def test_the_nearest_return_of_each_class_is_of_the_last_frame():
    assert around(FRAMES[0].tracks, FRAMES[0].proposals) == {
        "car": {"count": 1, "nearest_m": 0.0},
        "background": {"count": 1, "nearest_m": 0.0},
    }
    assert whole()["around"] == {"car": {"count": 1, "nearest_m": 7.5}}


def test_points_without_a_proposal_are_counted_by_kind():
    summary = Summary()
    for k in range(2 * COUNTED):
        summary.add_result(with_kinds(result(k, [5, 1], {0: 1, 1: 2}, n_points=22 + k // COUNTED)))
    figures = summary.result()
    assert figures["left_out"] == {
        "ground": 2,
        "structure": 2,
        "low": 2,
        "sparse": 2,
        "overhead": 2,
        "out_of_range": 2,
        "out_of_view": 2.5,
        "airborne": 2,
    }
    assert re.search(r"out of view +2\.5", summary_text(figures))
    assert "belong to no segment" not in summary_text(Summary().result())


def test_the_text_names_objects_and_costs_and_sums_the_stages_alone():
    summary = Summary()
    ms = {"source": 40, "segmentation": 3, "classification": 1}
    summary.add_ledger(ledger_line(0, **{stage: StageWork(cpu_ns=cpu_ms * 10**6) for stage, cpu_ms in ms.items()}))
    together, source = summary_text(summary.result()).splitlines()[-2:]
    assert together.split()[:2] == ["together", "4.00"]
    assert source.split()[0] == "source"
    text = summary_text(whole())
    for words in (r"car +1 +nearest 7\.5 m", r"N_go = 2\.3", r"beta 42\.9 %"):
        assert re.search(words, text)
    assert max(map(len, text.splitlines())) <= 100
