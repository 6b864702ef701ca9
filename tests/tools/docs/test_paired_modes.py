"""What tracking adds, on pairs of runs."""

from __future__ import annotations

import numpy as np
import pytest

from modt_desk.evaluation.evaluation import DriveRows
from tools.docs import paired_modes
from tools.docs.paired_modes import BASELINE, MODES, difference, interval
from tools.study import drives, sensors


@pytest.fixture(scope="module")
def rows() -> list[DriveRows]:
    """Two short drives in mode accurate."""
    made = [drives.simulated(scene, "vlp-16", 0.3, 3) for scene in ("street", "crossing")]
    return [sensors.run(drive, drive.profile, "accurate", drive.fov, k) for k, drive in enumerate(made)]


def perfect(drive: DriveRows) -> DriveRows:
    """The same drive with the true class of every proposal."""
    proposals = drive.proposals.copy()
    proposals["posterior"] = np.eye(4)[proposals["label"]]
    return DriveRows(drive.rules, drive.frames, drive.n_proposals, drive.classified, drive.objects, proposals, ())


@pytest.mark.slow
def test_a_mode_that_is_the_baseline_adds_nothing_in_any_draw(rows: list[DriveRows]) -> None:
    same = dict.fromkeys((BASELINE, *MODES), rows)
    for part in interval([same, same], "accurate", np.random.default_rng(0)):
        np.testing.assert_array_equal(part, 0.0)


@pytest.mark.slow
def test_a_better_mode_adds_something_and_the_interval_holds_the_mean(rows: list[DriveRows]) -> None:
    better = {BASELINE: rows, "accurate": [perfect(drive) for drive in rows]}
    mean, low, high = interval([better], "accurate", np.random.default_rng(0))
    np.testing.assert_array_equal(mean, difference(better, "accurate"))
    assert mean.max() > 0
    assert (low <= mean).all()
    assert (mean <= high).all()


@pytest.mark.slow
def test_the_section_has_a_row_for_each_mode_and_sensor(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(paired_modes, "SENSORS", ("vlp-16",))
    monkeypatch.setattr(paired_modes, "SEEDS", [3])
    monkeypatch.setattr(paired_modes, "SECONDS", 0.3)
    monkeypatch.setattr(paired_modes, "RESAMPLES", 3)
    text = list(paired_modes.table())
    assert [line.split(" | ")[0].strip("| ") for line in text[4:]] == [
        part for mode in MODES for part in (f"**`{mode}`, mean and 95 % interval**", f"`{mode}`, vlp-16")
    ]
