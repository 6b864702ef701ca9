"""Figures of the README and of the page on the paper, and the difference that tracking makes on pairs of runs."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from modt_evaluation.engine import Engine
from modt_evaluation.evaluation import DriveRows
from modt_evaluation.experiments.drives import kitti_drives
from modt_evaluation.experiments.study import DEFAULT, Row
from modt_simulation.synthetic_stream import SyntheticStream
from tests.recorded import written
from tools.docs import figures, paired_modes
from tools.docs.paired_modes import BASELINE, difference, interval
from tools.docs.paper_page import section
from tools.study import drives


def row(experiment, variant, quantity, value, stated, profile=DEFAULT):
    """A row of a recorded drive."""
    own = (experiment, "0005", "KITTI", profile, True, variant, None, quantity)
    return Row(*own, value, 0.0, 1.0, 2, stated, "0005")


def test_the_page_shows_what_tracking_adds_and_what_is_behind_the_paper():
    page = section(
        [
            row("table4", "det_only", "AP car", 0.9, 0.922),
            row("table4", "with_trk", "AP car", 0.98, 0.974),
            row("table6", "accurate", "discontinuities", 61.0, 38.0, profile="paper"),
            row("table6", "accurate", "N_go of objects", 5.74, 4.6, profile="paper"),
        ],
        "Commit x.",
    )
    tables, behind = page.split("## Where this falls short")
    assert "+8.0" in tables
    assert "discontinuities 61, not 38" in behind
    assert "AP car 0.9, not 0.922" in behind
    assert "0.98" not in behind
    assert "N_go" not in behind


@pytest.mark.slow
def test_the_table_has_a_row_for_each_sensor_and_the_text_the_cpu_time_of_the_modes(tmp_path, monkeypatch):
    written(tmp_path, SyntheticStream("street", "hdl-64e", 0.4, seed=2))
    monkeypatch.setattr(figures, "FIRST", 0)
    monkeypatch.setattr(figures, "SENSORS", {"vlp-16": "VLP-16"})
    monkeypatch.setattr(figures, "SEEDS", [2])
    monkeypatch.setattr(figures, "SECONDS", 0.4)
    (drive,) = kitti_drives(tmp_path)
    table, _, text = figures.readme(Engine(), drive.path, None, None).partition("\n\n")
    heads, _, row = (line.strip("| ").split(" | ") for line in table.splitlines())
    assert len(heads) == len(row)
    assert "VLP-16" in row[0]
    shares = re.findall(r"(\d\.\d\d) \(`(\w+)`\)", text)
    assert [name for _, name in shares] == ["accurate", "efficient"]
    assert all(float(share) > 0 for share, _ in shares)


@pytest.mark.slow
def test_a_better_mode_adds_something_and_one_that_is_the_baseline_nothing() -> None:
    made = [drives.simulated(scene, "vlp-16", 0.3, 3) for scene in paired_modes.SCENES]
    rows = [drives.judged(drive, "accurate", number) for number, drive in enumerate(made)]
    modes = {BASELINE: rows, "accurate": [perfect(drive) for drive in rows], "efficient": rows}
    mean, low, high = interval([modes], "accurate", np.random.default_rng(0))
    np.testing.assert_array_equal(mean, difference(modes, "accurate"))
    assert mean.max() > 0
    assert ((low <= mean) & (mean <= high)).all()
    for part in interval([modes, modes], "efficient", np.random.default_rng(0)):
        np.testing.assert_array_equal(part, 0.0)


def perfect(drive: DriveRows) -> DriveRows:
    """The same drive with the true class of every proposal."""
    proposals = drive.proposals.copy()
    proposals["posterior"] = np.eye(4)[proposals["label"]]
    return replace(drive, proposals=proposals)


@pytest.mark.slow
def test_the_table_of_weather_names_the_options_that_made_each_row(monkeypatch):
    monkeypatch.setattr(figures, "SEEDS", [2])
    monkeypatch.setattr(figures, "SECONDS", 0.4)
    _, _, *rows = figures.weather(Engine()).splitlines()
    made_by = [re.search(r"`(.*)`", row).group(1) for row in rows]
    assert made_by == ["--weather snow:2.5", "--weather fog:50", "--weather dust:1.5", "--gait 6"]
