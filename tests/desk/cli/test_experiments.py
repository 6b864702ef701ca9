from __future__ import annotations

import csv
import json

import pytest

from modt.cli.main import main
from modt_desk.experiments.output import png


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    out = tmp_path_factory.mktemp("results")
    words = ["evaluate", "--experiment", "table4", "budget", "fig15", "--simulated", "2", "--seconds", "0.3"]
    assert main([*words, "--out", str(out)]) == 0
    return out


def test_results_are_written_in_every_form(results):
    found = json.loads((results / "results.json").read_text())
    assert found["schema"] == "modt.experiments/1"
    with (results / "budget.csv").open() as table:
        own = [row for row in found["rows"] if row["experiment"] == "budget"]
        assert len(list(csv.DictReader(table))) == len(own) > 9
    picture = (results / "budget-2-simulated-drives-average-precision.svg").read_text()
    assert picture.startswith("<svg xmlns")
    assert "<polyline" in picture
    assert "accurate, AP car" in picture
    assert "Budget of classifications" in (results / "index.html").read_text()
    page = (results / "results.md").read_text()
    assert "## Table IV" in page
    assert "## Where this falls short" in page


def test_charts_are_pictures_too_with_the_extra(results):
    pytest.importorskip("resvg_py", reason="extra 'report' is not installed")
    image = pytest.importorskip("PIL.Image", reason="extra 'view' is not installed")
    if not png.draws_text():
        pytest.skip("no fonts are installed")
    with image.open(results / "budget-2-simulated-drives-average-precision.png") as picture:
        width, height = picture.size
        legend = picture.convert("L").crop((160, height - 30, width, height))
    assert width > height > 400
    assert len(legend.getcolors()) > 2, "there is text"


def test_charts_without_fonts_are_told(monkeypatch, caplog):
    pytest.importorskip("resvg_py", reason="extra 'report' is not installed")
    chart = {"a.svg": '<svg xmlns="http://www.w3.org/2000/svg" width="4" height="2"/>', "a.csv": ""}
    assert [name for name, _ in png.pictures(chart)] == ["a.png"]
    monkeypatch.setattr(png, "draws_text", lambda: False)
    caplog.clear()
    assert [name for name, _ in png.pictures(chart)] == ["a.png"]
    assert "no fonts; install some" in caplog.text


def test_energy_needs_a_calibration(results, tmp_path):
    board = tmp_path / "board.yaml"
    board.write_text(
        "energy: {board: desk, meter: INA (integrated), seg_J: 0.05, class_J: 1.0e-3, point_J: 1.0e-5}\n"
    )
    words = ["evaluate", "--experiment", "budget", "--simulated", "2", "--seconds", "0.3"]
    cache = results / "cache"
    before = sorted(cache.rglob("*.npz"))
    assert main([*words, "--calibration", str(board), "--out", str(tmp_path), "--cache", str(cache)]) == 0
    made = json.loads((tmp_path / "results.json").read_text())
    row = {(r["variant"], r["at"], r["quantity"]): r["value"] for r in made["rows"]}
    for at in (0.0, 3.0):
        calls, points, energy = (
            row["accurate", at, name]
            for name in ("calls a frame", "points classified a frame", "energy of classification a frame [mJ]")
        )
        assert energy == pytest.approx(calls + 0.01 * points, rel=1e-4)
    assert energy > 0
    assert len(sorted(cache.rglob("*.npz"))) == len(before) + 1, "replays are those of before"
    assert made["about"]["energy"] == ["desk, INA (integrated)"]
    assert "desk, INA (integrated)" in (tmp_path / "results.md").read_text()


def test_simulated_drives_stand_apart_and_beside_no_figure_of_the_paper(results):
    found = json.loads((results / "results.json").read_text())["rows"]
    assert {row["kind"] for row in found} == {"simulated"}
    assert {row["paper"] for row in found} == {None}


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
    rows = json.loads((tmp_path / "out" / "results.json").read_text())["rows"]
    assert [row["profile"] for row in rows].count("default") == len(rows) / 2
    assert f"with_trk, profile {other}" in (tmp_path / "out" / "results.md").read_text()
