from __future__ import annotations

import csv

import pytest

from modt.cli.main import main
from modt_desk.experiments.catalogue.budget import BUDGETS, CONVENTIONAL

pytestmark = pytest.mark.command


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    out = tmp_path_factory.mktemp("results")
    words = ["evaluate", "--experiment", "table4", "budget", "fig15", "--simulated", "2", "--seconds", "0.3"]
    assert main([*words, "--out", str(out)]) == 0
    return out


def table(folder):
    with (folder / "results.csv").open() as file:
        return list(csv.DictReader(file))


def test_results_are_written_as_a_table_and_a_document(results):
    own = [row for row in table(results) if row["experiment"] == "budget"]
    assert {(row["variant"], row["at"]) for row in own if row["quantity"] == "calls a frame"} == {
        *(("accurate", f"{n:.1f}") for n in BUDGETS),
        (CONVENTIONAL, ""),
    }
    page = (results / "results.md").read_text()
    assert "## Table IV" in page
    assert "## Where this falls short" in page
    assert "## Budget of classifications" in page


def test_charts_are_drawn_with_the_extra(results, tmp_path):
    pytest.importorskip("matplotlib", reason="extra 'view' is not installed")
    name = "budget-2-simulated-drives-average-precision"
    picture = (results / f"{name}.svg").read_text()
    assert "accurate, AP car" in picture
    assert (results / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def test_without_the_extra_there_are_no_charts(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr("modt_desk.cli.experiments.find_spec", lambda name: None)
    words = ["evaluate", "--experiment", "budget", "--simulated", "1", "--seconds", "0.2", "--out", str(tmp_path)]
    assert main(words) == 0
    assert ".[view]" in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["results.csv", "results.md"]


def test_energy_needs_a_calibration(results, tmp_path):
    energy = "energy of classification a frame [mJ]"
    assert energy not in {row["quantity"] for row in table(results)}
    board = tmp_path / "board.yaml"
    board.write_text(
        "energy: {board: desk, meter: INA (integrated), seg_J: 0.05, class_J: 1.0e-3, point_J: 1.0e-5}\n"
    )
    words = ["evaluate", "--experiment", "budget", "--simulated", "2", "--seconds", "0.3"]
    assert main([*words, "--calibration", str(board), "--out", str(tmp_path)]) == 0
    row = {(r["variant"], r["at"], r["quantity"]): r["value"] for r in table(tmp_path)}
    for at in ("0.0", "3.0"):
        calls, points, spent = (
            float(row["accurate", at, name]) for name in ("calls a frame", "points classified a frame", energy)
        )
        assert spent == pytest.approx(calls + 0.01 * points, rel=1e-4)
    assert spent > 0
    assert "desk, INA (integrated)" in (tmp_path / "results.md").read_text()


def test_simulated_drives_stand_apart_and_beside_no_figure_of_the_paper(results):
    found = table(results)
    assert {row["kind"] for row in found} == {"simulated"}
    assert {row["paper"] for row in found} == {""}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--experiment", "table9", "--simulated", "1"], "table3"),
        (["--experiment", "table4"], "no drives"),
        (["--experiment", "budget", "--simulated", "1", "--calibration", "hdl-64e"], "calibrate"),
        (["--experiment", "budget", "--simulated", "1", "--calibration", "a", "--calibration", "b"], "more of them"),
        (["RUN", "--experiment", "table4"], "takes no runs"),
        (["--experiment", "table3", "--simulated", "1"], "none of the drives"),
    ],
)
def test_misuse_is_told(words, said, capsys, tmp_path):
    if "RUN" in words:
        words = ["RUN", "TRUTH", *words[1:]]
    assert main(["evaluate", *words, "--out", str(tmp_path)]) == 2
    assert said in capsys.readouterr().err


def test_another_profile_stands_beside_the_first(tmp_path):
    other = tmp_path / "other.yaml"
    other.write_text("fusion:\n  start_frame: 1\n")
    words = ["evaluate", "--experiment", "table4", "--simulated", "1", "--seconds", "0.2", "--beside", str(other)]
    assert main([*words, "--out", str(tmp_path / "out")]) == 0
    rows = table(tmp_path / "out")
    assert [row["profile"] for row in rows].count("default") == len(rows) / 2
    assert f"with_trk, profile {other}" in (tmp_path / "out" / "results.md").read_text()
