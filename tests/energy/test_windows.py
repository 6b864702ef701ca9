import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modt.config import EnergyConfig
from modt.energy.attribution import attribute
from modt.energy.ledger import Ledger
from modt.energy.meters.discovery import find_hwmon, find_powercap
from modt.energy.meters.meter import Conditions, model_meter
from modt.energy.windows import SCHEMA, Windows

from .simulated import CALIBRATED, SimulatedMachine, line_of, write_files


class Metered:
    """A machine, its ledger, and the windows of its counter or of other meters."""

    def __init__(self, sys, *meters, tick_ns=0):
        self.machine = machine = SimulatedMachine(sys)

        def ticking_ns():
            machine.now_ns += tick_ns
            return machine.now_ns

        self.ledger = Ledger(ticking_ns, lambda: machine.cpu_ns)
        self.windows = Windows(meters or find_powercap(sys)[0].meters, machine.clocks, Conditions(0, sys))

    def frame(self, index, wait_s):
        self.machine.wait(wait_s)
        line = self.ledger.close_frame(index)
        assert line["marks"] == []
        return self.windows.add(line)

    def second(self, index=0):
        """Work for a second, as one frame that fills one window."""
        self.ledger.run("segmentation", self.machine.work, 0.25, 0.5, 3)
        return self.frame(index, 0.75)


@pytest.fixture
def metered(tmp_path):
    """A machine after its first window, which is short: a counter is judged by the power measured before."""
    made = Metered(tmp_path)
    line = made.frame(0, 0.1)
    assert (line["energy_J"], line["marks"]) == (None, ["first"])
    return made


def test_window_has_its_energy_and_counts(metered):
    line = metered.second(7)
    assert line["schema"] == SCHEMA
    assert line["frames"] == [7, 7, 1]
    assert line["energy_J"] == pytest.approx(3.0 + 0.5, abs=2 * 61e-6)
    assert line["kind"] == "measured"
    counts = {"calls": 1, "items": 3, "points": 0, "wall_ns": 250_000_000, "cpu_ns": 250_000_000}
    assert line["stages"]["segmentation"] == counts
    assert line["process_ns"] == 250_000_000
    assert line["conditions"] == {"governor": "performance", "frequency_MHz": 2600.0, "temperature_C": None}
    assert line["marks"] == []
    assert metered.frame(8, 0.9) is None
    assert metered.frame(9, 0.1)["frames"] == [8, 9, 2]
    line = metered.second(10)  # the counter begins anew
    assert (line["energy_J"], line["marks"]) == (pytest.approx(3.5, abs=2 * 61e-6), ["wrap"])


def test_lost_meter_is_marked_and_resumes(metered):
    metered.second()
    metered.machine.vanish()
    lost = [metered.second() for _ in range(2)]
    metered.machine.appear()
    back, good = metered.second(), metered.second()
    assert [(line["energy_J"], line["kind"], line["marks"]) for line in lost] == [(None, "unavailable", ["lost"])] * 2
    assert (back["energy_J"], back["marks"]) == (None, ["back"])
    assert good["energy_J"] == pytest.approx(3.5, abs=1e-3)


def test_window_of_a_suspension_has_no_energy(metered):
    metered.second()
    metered.machine.suspend(3600.0)
    line = metered.second()
    assert line["energy_J"] is None
    assert "suspended" in line["marks"]
    assert metered.second()["energy_J"] == pytest.approx(3.5, abs=1e-3)


def test_power_is_integrated_between_edges(tmp_path):
    files = {"name": "ina226", "power1_input": 4_000_000, "in1_input": 5000, "curr1_input": 800}
    rail = write_files(tmp_path / "class" / "hwmon" / "hwmon0", **files)
    metered = Metered(tmp_path, *find_hwmon(tmp_path)[0].meters)
    (rail / "power1_input").write_text("6000000\n")
    line = metered.second()
    assert (line["energy_J"], line["kind"]) == (pytest.approx(5.0), "integrated")
    (rail / "power1_input").write_text("-20000\n")
    line = metered.second()
    assert (line["energy_J"], line["kind"], line["marks"]) == (None, "unavailable", ["negative"])


FRAMES = st.lists(st.tuples(st.floats(0, 0.6), st.floats(0, 0.6), st.integers(0, 4)), max_size=8)


@settings(max_examples=40)
@given(FRAMES, st.integers(0, 300))
def test_parts_of_every_window_sum_to_it(tmp_path_factory, frames, tick_ns):
    metered = Metered(tmp_path_factory.mktemp("sys"), tick_ns=tick_ns)
    start, lines = metered.machine.now_ns, []
    for index, (busy, idle, items) in enumerate(frames):
        metered.ledger.run("tracking", metered.machine.work, busy, busy, items)
        lines.append(metered.frame(index, idle))
    lines.append(metered.windows.close())
    closed = [line for line in lines if line is not None]
    for line in closed:
        spans = sum(row["wall_ns"] for row in line["stages"].values())
        assert spans + line["overhead_ns"] + line["idle_ns"] == line["wall_ns"]
        assert min(line["overhead_ns"], line["idle_ns"]) >= 0
    assert sum(line["wall_ns"] for line in closed) == metered.machine.now_ns - start
    assert sum(line["frames"][2] for line in closed) == len(frames)
    assert [line["window"] for line in closed] == list(range(len(closed)))


def test_a_window_is_as_reliable_as_its_least_reliable_meter(metered):
    machine = metered.machine
    counter = find_powercap(machine.sys)[0].meters[0]
    model = model_meter(EnergyConfig(), machine.clocks.monotonic_ns, machine.clocks.process_ns)
    for meters, found in (
        ((counter, model), (pytest.approx(6.0, abs=1e-3), "estimated")),
        ((), (None, "unavailable")),
    ):
        windows = Windows(meters, machine.clocks, Conditions(0, machine.sys))
        for _ in range(2):
            machine.wait(1.0)
            line = windows.close()
        assert (line["energy_J"], line["kind"]) == found


@given(energy_J=st.floats(0, 20), frames=st.integers(0, 9), load=st.integers(0, 9))
def test_the_energy_attributed_to_the_parts_of_a_window_is_its_own(energy_J, frames, load):
    line = line_of(energy_J, frames, load)
    for board in (EnergyConfig(), CALIBRATED):
        assert sum(attribute(line, board).values()) == pytest.approx(energy_J)


def test_coefficients_split_the_reading_of_a_calibrated_board_but_not_the_model():
    parts = attribute(line_of(5.0, 2, 4), CALIBRATED)
    expected = {"idle": 3.0, "segmentation": 0.2, "classification": 0.04 + 0.036, "unattributed": 1.724}
    assert parts == pytest.approx(expected)
    estimated = line_of(5.0, 2, 4, kind="estimated")
    assert attribute(estimated, CALIBRATED) == attribute(estimated, EnergyConfig())
