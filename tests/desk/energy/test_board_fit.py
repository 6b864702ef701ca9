from typing import Any

import numpy as np
import pytest
from scipy import optimize

from modt.energy.meters.discovery import find_powercap
from modt.energy.meters.meter import Conditions
from modt.energy.windows import Windows
from modt_desk.energy.board_fit import CLASS, SEG, FitError, fit, nonnegative_fit, unit_energy_J
from tests.energy.simulated import SimulatedMachine, line_of

TRUE = {"idle_W": 3.0, "seg_J": 0.2, "class_J": 0.015, "point_J": 4e-5}
NOISE = 0.1


def drive(machine: SimulatedMachine, windows: int) -> list[dict[str, Any]]:
    """Windows of a calibration with noise, during which the meter comes and goes."""
    random = machine.random
    ledger = machine.ledger()
    recorder = Windows(find_powercap(machine.sys)[0].meters, machine.clocks, Conditions(0, machine.sys))
    lines = []
    for _ in range(windows):
        if not machine.zone.is_dir():
            machine.appear()
        elif random.random() < 0.1:
            machine.vanish()
        frames, load = int(random.integers(1, 9)), int(random.integers(0, 60))
        luck = 1 + NOISE * random.standard_normal()
        for _ in range(frames):
            ledger.run("segmentation", machine.work, 0.01, luck * TRUE["seg_J"])
            items, points = load, load * int(random.integers(20, 400))
            joules = luck * (TRUE["class_J"] * items + TRUE["point_J"] * points)
            ledger.run("classification", machine.work, 0.01, joules, items)
            ledger.count("classification", points=points)
        seconds = random.uniform(1.0, 2.0)
        machine.true_J += luck * TRUE["idle_W"] * seconds
        machine.wait(seconds - 0.02 * frames)
        line = recorder.add(ledger.close_frame(0))
        assert line is not None
        lines.append(line)
    return lines


@pytest.mark.slow
def test_intervals_cover_the_truth_through_noise_wraps_and_drop_outs(tmp_path):
    """The counter passes its range on the way."""
    hits = dict.fromkeys(TRUE, 0)
    marks: list[str] = []
    for seed in range(50):
        machine = SimulatedMachine(tmp_path / str(seed), idle_W=0.0, wrap_uJ=2_500_000_000, step_uJ=61.035, seed=seed)
        machine.true_J = 2450.0
        machine.wait(0.0)
        lines = drive(machine, 40)
        result = fit(lines, np.random.default_rng(seed))
        marks += [mark for line in lines for mark in line["marks"]]
        assert result.windows + result.dropped == len(lines)
        for c in result.coefficients:
            hits[c.name] += c.low <= TRUE[c.name] <= c.high
            assert 0.0 <= c.low <= c.value <= c.high
    assert min(hits.values()) >= 45
    assert marks.count("wrap") > 10
    assert marks.count("lost") > 50


def windows(loads, energy_J):
    """Windows of these segmentations, classifications and points, and an energy that they give."""
    lines = [line_of(energy_J(n, m), n, m) for n, m, _ in loads.tolist()]
    for line, points in zip(lines, loads[:, 2].tolist(), strict=True):
        line["stages"]["classification"]["points"] = points
    return lines


LOADS = np.random.default_rng(0).integers(1, 60, (24, 3))


@pytest.mark.parametrize(
    ("lines", "cause"),
    [
        (windows(LOADS, lambda n, m: 9.0 + 0.2 * n - 0.1 * m), r"class_J is -0\.1 .* gives no energy back"),
        ([line_of(3.0 + n, n, 10 * n) for n in range(1, 20)], "varied together"),
        ([line_of(3.0 + n, n) for n in range(1, 20)], "class_J, point_J"),
        ([line_of(None, 1), line_of(3.0, 1, marks=["suspended"]), line_of(3.0, 1)], "at least 8"),
    ],
)
def test_windows_that_determine_no_coefficient_are_refused(lines, cause):
    with pytest.raises(FitError, match=cause):
        fit(lines, np.random.default_rng(0))


def test_work_that_costs_nothing_is_bounded_at_zero():
    random = np.random.default_rng(1)
    bounded = covered = 0
    for _ in range(20):
        loads = random.integers([1, 1, 100], [60, 60, 9000], (24, 3))
        result = fit(windows(loads, lambda n, m: 3.0 + 0.2 * n + 0.05 * random.standard_normal()), random)
        assert all(0.0 <= c.low <= c.value <= c.high for c in result.coefficients)
        covered += result["class_J"].low == 0.0
        bounded += result["class_J"].value == 0.0
    assert 0 < bounded < 20
    assert covered >= 18


def test_unit_energy_of_bursts_is_the_true_one(tmp_path):
    machine = SimulatedMachine(tmp_path, idle_W=3.0)
    ledger = machine.ledger()
    recorder = Windows(find_powercap(tmp_path)[0].meters, machine.clocks, Conditions(0, tmp_path))
    lines = []
    for _ in range(5):
        for _ in range(50):
            ledger.run("segmentation", machine.work, 0.02, TRUE["seg_J"])
        machine.wait(0.0)
        line = recorder.add(ledger.close_frame(0))
        assert line is not None
        lines.append(line)
    assert unit_energy_J(lines, 3.0, SEG) == pytest.approx(TRUE["seg_J"], rel=1e-3)
    assert unit_energy_J(lines, 3.0, CLASS) is None


@pytest.mark.parametrize("true", [[2.0, 3.0, 1e-4], [2.0, -3.0, 1e-4], [-1.0, 3.0, -1.0]])
def test_it_is_the_bounded_solution_of_the_whole_problem(true):
    random = np.random.default_rng(0)
    X = random.uniform(0, 1, (200, 3)) * [1, 10, 1000]
    y = X @ true + random.standard_normal(200)
    found = nonnegative_fit(X.T @ X, X.T @ y)
    np.testing.assert_allclose(found, optimize.nnls(X, y)[0], rtol=1e-6, atol=1e-9)
    assert (found >= 0).all()
