"""The difference that tracking makes, on pairs of runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modt_desk.evaluation.evaluation import DriveRows
from tools.docs import paired_modes
from tools.docs.paired_modes import BASELINE, MODES, difference, interval
from tools.study import drives


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
def test_the_section_has_a_row_for_each_mode_and_sensor(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(paired_modes, "SENSORS", ("vlp-16",))
    monkeypatch.setattr(paired_modes, "SEEDS", [3])
    monkeypatch.setattr(paired_modes, "SECONDS", 0.3)
    monkeypatch.setattr(paired_modes, "RESAMPLES", 3)
    text = list(paired_modes.table())
    assert [line.split(" | ")[0].strip("| ") for line in text[4:]] == [
        part for mode in MODES for part in (f"**`{mode}`, mean and 95 % interval**", f"`{mode}`, vlp-16")
    ]
