from dataclasses import replace

import numpy as np
import pytest

from modt.config import EnergyConfig
from modt.energy.ledger import Ledger
from modt.energy.meters.meter import Conditions, Facts, Kind, Scope
from modt.energy.windows import Clocks, Windows
from modt.types import UNLIMITED, Frame
from modt_profiling.comparison.compare_report import Basis, compare_tree
from modt_profiling.comparison.compare_view import compare_document
from modt_profiling.comparison.comparison import ModeRun, interleave
from modt_profiling.reporting.energy_plots import stage_energy_mJ
from modt_profiling.reporting.quantity import to_json
from tests.modt_profiling.reporting.test_run_report import KINDS, figures
from tests.results import CAR, result

MODES = ("conventional", "efficient", "accurate")
FRAMES = [Frame(k, k / 10, np.zeros((40, 4), np.float32)) for k in range(40)]
EVERY = {"conventional": 1, "efficient": 20, "accurate": 5, "varied": 2}
"""Both proposals are classified every so many frames, by mode."""
BUSY_W = 5.0


FACTS = Facts(name="board", unit="J", resolution=1e-6, max_W=100.0, scope=Scope.CPU, kind=Kind.MEASURED)


def two_cars(index):
    """Result of a frame with two cars."""
    return result(index, [3, 4], {0: 7, 1: 8}, {7: CAR, 8: CAR})


class Board:
    """A pipeline whose work moves the clocks and the counter of a board.

    It segments in 10 ms or a little more, tracks in 2, and classifies in 1 and 1 for each proposal.
    """

    facts = FACTS

    def __init__(self, every=1):
        self.every = every
        self.now_ns = 0
        self.ledger = Ledger(self.clock, self.clock)

    def clock(self):
        return self.now_ns

    def read(self):
        return BUSY_W * self.now_ns / 1e9

    def work(self, ms, value=None):
        self.now_ns += round(ms * 1e6)
        return value

    def seen(self, index):
        """Result of a frame, and the tracks that are classified."""
        return two_cars(index), [7, 8] * (index % self.every == 0)

    def step(self, frame, budget=UNLIMITED):
        found, classified = self.seen(frame.index)
        self.ledger.run("segmentation", self.work, 10.0 + frame.index % 3)
        self.ledger.run("tracking", self.work, 2.0)
        if classified:
            count = len(classified)
            self.ledger.run("classification", self.work, 1.0 + count, np.tile(CAR, (count, 1)))
        return replace(found, classified=np.array(classified, np.int64))


def mode_run(name, metered):
    board = Board(EVERY[name])
    windows = None
    if metered:
        windows = Windows([board], Clocks(board.clock, board.clock, board.clock), Conditions(), min_s=0.1)
        for _ in range(2):  # its power is known
            board.work(100)
            windows.close()
    return ModeRun(board, board.ledger, lambda index: UNLIMITED, windows)


def tree_of(metered, coefficients=None):
    made = {name: mode_run(name, metered) for name in EVERY}
    interleave(FRAMES, [*made.values()], 10**9 if metered else 1)
    kind = Kind.MEASURED if metered else Kind.ESTIMATED
    seg_J, class_J, point_J = coefficients or (None, None, None)
    config = EnergyConfig(idle_W=1.0, busy_W=4.0, seg_J=seg_J, class_J=class_J, point_J=point_J)
    basis = Basis(config, replace(FACTS, kind=kind), period_s=0.1)
    about = {
        "stream": "street", "frames": len(FRAMES), "fov": "full", "repeat": 1, "turn": 1, "basis": "at 10 Hz",
        "board": "test", "conditions": {"governor": None, "frequency_MHz": None, "core": 0},
    }  # fmt: skip
    return compare_tree([made], MODES, "varied", basis, about)


@pytest.fixture(scope="module")
def estimated():
    return tree_of(metered=False)


@pytest.fixture(scope="module")
def measured():
    return tree_of(metered=True)


def test_meters_are_read_at_the_ends_of_turns():
    made = [mode_run("conventional", metered=True) for _ in range(2)]
    interleave(FRAMES[:6], made, turn=3)
    for each in made:
        assert [window.n_frames for window in each.energy_lines] == [3, 3]
        assert all(window.energy_J > 0 for window in each.energy_lines)


MEAN_MS = {"conventional": 10.975 + 2 + 3, "efficient": 10.975 + 2 + 3 / 20, "accurate": 10.975 + 2 + 3 / 5}


@pytest.mark.parametrize("mode", MODES)
def test_estimated_energy_is_watts_times_cpu_time_and_measured_energy_that_of_the_meter(estimated, measured, mode):
    found = estimated["modes"][mode]
    metered = measured["modes"][mode]
    assert found["cpu_ms"].value == pytest.approx(MEAN_MS[mode])
    assert found["net_J"].value == pytest.approx(3.0 * MEAN_MS[mode] / 1e3)
    assert found["gross_J"].value == pytest.approx(0.1 + 3.0 * MEAN_MS[mode] / 1e3)
    assert metered["gross_J"].value == pytest.approx(BUSY_W * MEAN_MS[mode] / 1e3)
    assert metered["net_J"].value == pytest.approx((BUSY_W - 1.0) * MEAN_MS[mode] / 1e3)
    assert metered["gross_J"].low <= metered["gross_J"].value <= metered["gross_J"].high
    assert (found["gross_J"].kind, metered["gross_J"].kind) == (Kind.ESTIMATED, Kind.MEASURED)
    for each in (found, metered):
        assert sum(s["energy_J"].value for s in each["stages"].values()) == pytest.approx(each["net_J"].value)
    for stage, mJ in stage_energy_mJ(measured["series"][mode]).items():
        assert mJ.mean() == pytest.approx(1e3 * metered["stages"][stage]["energy_J"].value)


def test_known_costs_are_reconciled(estimated):
    calibrated = tree_of(False, coefficients=(3.0 * 10.975e-3, 3.0 * 1.5e-3, 0.0))
    for mode in MODES[1:]:
        saving = estimated["savings"][mode]
        expected = MEAN_MS["conventional"] / MEAN_MS[mode]
        assert saving["gamma_measured_cpu"].value == pytest.approx(expected)
        assert saving["deviation"].value == pytest.approx(0.0, abs=1e-6)
        assert saving["gamma_net"].value == pytest.approx(expected)
        assert 1.0 < saving["gamma_gross"].value < saving["gamma_net"].value
        assert calibrated["savings"][mode]["gamma_calibrated"].value == pytest.approx(expected)


def test_the_report_says_whether_it_tests_the_physics(estimated, measured):
    tests = [" ".join(compare_document(tree).text().split()) for tree in (estimated, measured)]
    assert ["not the physics" in text for text in tests] == [True, False]
    assert ["against the meter" in text for text in tests] == [False, True]


def test_every_figure_carries_its_kind(measured):
    found = [f for f in figures(to_json(measured)) if f.get("bare") is None]
    assert all(f["kind"] in KINDS for f in found)
