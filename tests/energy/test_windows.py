import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modt.config import EnergyConfig
from modt.energy.attribution import attribute
from modt.energy.ledger import Ledger, StageWork
from modt.energy.meters.discovery import find_powercap
from modt.energy.meters.meter import Conditions, Kind, model_meter
from modt.energy.windows import SCHEMA, Clocks, Windows

from .meter_files import CALIBRATED, RANGE_UJ, window_of, write_files, write_zone

STEP_UJ = 61.035
IDLE_W = 3.0


class Machine:
    """A machine that draws power, its ledger, and the windows of its counter.

    Its clocks advance with its work. It counts energy in a powercap file, in steps and with overflow.
    """

    def __init__(self, sys, tick_ns=0):
        self.true_J = 1e-6 * RANGE_UJ - 7.0
        self.tick_ns = tick_ns
        self.now_ns = self.cpu_ns = 1_000_000_000
        self.slept_ns = 0
        self.zone = sys / "class" / "powercap" / "intel-rapl:0"
        write_zone(self.zone, "package-0")
        cpufreq = sys / "devices" / "system" / "cpu" / "cpu0" / "cpufreq"
        write_files(cpufreq, scaling_governor="performance", scaling_cur_freq=2600000)
        self.wait(0.0)
        self.clocks = Clocks(lambda: self.now_ns, lambda: self.now_ns + self.slept_ns, lambda: self.cpu_ns)
        self.ledger = Ledger(self.ticking_ns, lambda: self.cpu_ns)
        self.windows = Windows(find_powercap(sys)[0].meters, self.clocks, Conditions(0, sys))

    def ticking_ns(self):
        self.now_ns += self.tick_ns
        return self.now_ns

    def work(self, seconds, joules, items=0):
        """Compute for a while. The energy comes on top of the idle power and shows after the next wait."""
        self.cpu_ns += round(seconds * 1e9)
        self.now_ns += round(seconds * 1e9)
        self.true_J += joules + IDLE_W * seconds
        return range(items)

    def wait(self, seconds):
        self.now_ns += round(seconds * 1e9)
        self.true_J += IDLE_W * seconds
        if self.zone.is_dir():
            counted_uJ = int(int(1e6 * self.true_J / STEP_UJ) * STEP_UJ) % RANGE_UJ
            write_files(self.zone, energy_uj=counted_uJ)

    def frame(self, index, wait_s):
        self.wait(wait_s)
        line = self.ledger.close_frame(index)
        assert line.marks == []
        return self.windows.add(line)

    def second(self, index=0):
        """Work for a second, as one frame that fills one window."""
        self.ledger.run("segmentation", self.work, 0.25, 0.5, 3)
        return self.frame(index, 0.75)


@pytest.fixture
def machine(tmp_path):
    """A machine after its first window, which is short: a counter is judged by the power measured before."""
    made = Machine(tmp_path)
    line = made.frame(0, 0.1)
    assert (line.energy_J, line.marks) == (None, ["first"])
    return made


def test_window_has_its_energy_and_counts(machine):
    line = machine.second(7)
    assert line.schema == SCHEMA
    assert line.frames == (7, 7, 1)
    assert line.energy_J == pytest.approx(3.0 + 0.5, abs=2 * 61e-6)
    assert line.kind == "measured"
    assert line.stages["segmentation"] == StageWork(1, 3, 0, 250_000_000, 250_000_000)
    assert line.process_ns == 250_000_000
    assert line.conditions == {"governor": "performance", "frequency_MHz": 2600.0, "temperature_C": None}
    assert line.marks == []
    assert machine.frame(8, 0.9) is None
    assert machine.frame(9, 0.1).frames == (8, 9, 2)
    line = machine.second(10)  # the counter begins anew
    assert (line.energy_J, line.marks) == (pytest.approx(3.5, abs=2 * 61e-6), ["wrap"])


def test_lost_meter_is_marked_and_resumes(machine):
    machine.second()
    machine.zone.rename(machine.zone.with_name("gone"))
    lost = [machine.second() for _ in range(2)]
    machine.zone.with_name("gone").rename(machine.zone)
    back = machine.second()
    good = machine.second()
    assert [(line.energy_J, line.kind, line.marks) for line in lost] == [(None, "unavailable", ["lost"])] * 2
    assert (back.energy_J, back.marks) == (None, ["back"])
    assert good.energy_J == pytest.approx(3.5, abs=1e-3)


def test_window_of_a_suspension_has_no_energy(machine):
    machine.second()
    machine.slept_ns += 3600 * 10**9
    line = machine.second()
    assert line.energy_J is None
    assert "suspended" in line.marks
    assert machine.second().energy_J == pytest.approx(3.5, abs=1e-3)


FRAMES = st.lists(st.tuples(st.floats(0, 0.6), st.floats(0, 0.6), st.integers(0, 4)), max_size=8)


@settings(max_examples=40)
@given(FRAMES, st.integers(0, 300))
def test_parts_of_every_window_sum_to_it(tmp_path_factory, frames, tick_ns):
    machine = Machine(tmp_path_factory.mktemp("sys"), tick_ns=tick_ns)
    start = machine.now_ns
    lines = []
    for index, (busy, idle, items) in enumerate(frames):
        machine.ledger.run("tracking", machine.work, busy, busy, items)
        lines.append(machine.frame(index, idle))
    lines.append(machine.windows.close())
    closed = [line for line in lines if line is not None]
    for line in closed:
        spans = sum(row.wall_ns for row in line.stages.values())
        assert spans + line.overhead_ns + line.idle_ns == line.wall_ns
        assert min(line.overhead_ns, line.idle_ns) >= 0
    assert sum(line.wall_ns for line in closed) == machine.now_ns - start
    assert sum(line.n_frames for line in closed) == len(frames)
    assert [line.window for line in closed] == list(range(len(closed)))


def test_a_window_is_as_reliable_as_its_least_reliable_meter(machine, tmp_path):
    counter = find_powercap(tmp_path)[0].meters[0]
    model = model_meter(EnergyConfig(), machine.clocks.monotonic_ns, machine.clocks.process_ns)
    for meters, found in (
        ((counter, model), (pytest.approx(6.0, abs=1e-3), "estimated")),
        ((), (None, "unavailable")),
    ):
        windows = Windows(meters, machine.clocks, Conditions(0, tmp_path))
        for _ in range(2):
            machine.wait(1.0)
            line = windows.close()
        assert (line.energy_J, line.kind) == found


@given(energy_J=st.floats(0, 20), frames=st.integers(0, 9), load=st.integers(0, 9))
def test_the_energy_attributed_to_the_parts_of_a_window_is_its_own(energy_J, frames, load):
    line = window_of(energy_J, frames, load)
    for board in (EnergyConfig(), CALIBRATED):
        assert sum(attribute(line, board).values()) == pytest.approx(energy_J)


def test_coefficients_split_the_reading_of_a_calibrated_board_but_not_the_model():
    parts = attribute(window_of(5.0, 2, 4), CALIBRATED)
    expected = {"idle": 3.0, "segmentation": 0.2, "classification": 0.04 + 0.036, "unattributed": 1.724}
    assert parts == pytest.approx(expected)
    estimated = window_of(5.0, 2, 4, kind=Kind.ESTIMATED)
    assert attribute(estimated, CALIBRATED) == attribute(estimated, EnergyConfig())


def test_a_process_that_stalls_between_the_readings_of_two_clocks_was_not_suspended():
    now_ns = 0

    def stalling_ns():
        nonlocal now_ns
        now_ns += 300_000_000
        return now_ns

    windows = Windows((), Clocks(stalling_ns, stalling_ns, lambda: 0), Conditions())
    assert "suspended" not in windows.close().marks
