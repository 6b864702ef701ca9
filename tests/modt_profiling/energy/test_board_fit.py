import numpy as np
import pytest
from scipy import optimize

from modt_profiling.energy.board_fit import CLASS, SEG, FitError, fit, nonnegative_fit, unit_energy_J
from tests.energy.meter_files import window_of

TRUE = {"idle_W": 3.0, "seg_J": 0.2, "class_J": 0.015, "point_J": 4e-5}


def windows(loads, energy_J):
    """Windows of a second of these segmentations, classifications and points, and an energy that they give."""
    lines = []
    for n, m, points in loads.tolist():
        lines.append(window_of(energy_J(n, m, points), n, m))
        lines[-1].stages["classification"].points = points
    return lines


@pytest.mark.slow
def test_intervals_cover_the_truth_through_noise_and_windows_without_energy():
    hits = dict.fromkeys(TRUE, 0)
    for seed in range(50):
        random = np.random.default_rng(seed)

        def drawn_J(*load, random=random):
            true_J = np.dot([*TRUE.values()], [1.0, *load])
            return None if random.random() < 0.1 else true_J * (1 + 0.1 * random.standard_normal())

        lines = windows(random.integers([1, 0, 0], [9, 60, 24_000], (40, 3)), drawn_J)
        result = fit(lines, random)
        assert result.windows + result.dropped == len(lines)
        assert result.dropped == sum(line.energy_J is None for line in lines)
        for c in result.coefficients:
            hits[c.name] += c.low <= TRUE[c.name] <= c.high
            assert 0.0 <= c.low <= c.value <= c.high
    assert min(hits.values()) >= 45


LOADS = np.random.default_rng(0).integers(1, 60, (24, 3))


@pytest.mark.parametrize(
    ("lines", "cause"),
    [
        (windows(LOADS, lambda n, m, _: 9.0 + 0.2 * n - 0.1 * m), r"class_J is -0\.1 .* gives no energy back"),
        ([window_of(3.0 + n, n, 10 * n) for n in range(1, 20)], "varied together"),
        ([window_of(3.0 + n, n) for n in range(1, 20)], "class_J, point_J"),
        ([window_of(None, 1), window_of(3.0, 1, marks=["suspended"]), window_of(3.0, 1)], "at least 8"),
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
        result = fit(windows(loads, lambda n, *_: 3.0 + 0.2 * n + 0.05 * random.standard_normal()), random)
        assert all(0.0 <= c.low <= c.value <= c.high for c in result.coefficients)
        covered += result["class_J"].low == 0.0
        bounded += result["class_J"].value == 0.0
    assert 0 < bounded < 20
    assert covered >= 18


def test_unit_energy_of_bursts_is_the_true_one():
    lines = [window_of(3.0 + n * TRUE["seg_J"], n) for n in (40, 50, 60)]
    assert unit_energy_J(lines, 3.0, SEG) == pytest.approx(TRUE["seg_J"])
    assert unit_energy_J(lines, 3.0, CLASS) is None


@pytest.mark.parametrize("true", [[2.0, 3.0, 1e-4], [2.0, -3.0, 1e-4], [-1.0, 3.0, -1.0]])
def test_it_is_the_bounded_solution_of_the_whole_problem(true):
    random = np.random.default_rng(0)
    X = random.uniform(0, 1, (200, 3)) * [1, 10, 1000]
    y = X @ true + random.standard_normal(200)
    found = nonnegative_fit(X.T @ X, X.T @ y)
    np.testing.assert_allclose(found, optimize.nnls(X, y)[0], rtol=1e-6, atol=1e-9)
    assert (found >= 0).all()
