from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modt.energy.ledger import Ledger
from modt.energy.meters.discovery import find_hwmon, find_powercap
from modt.energy.meters.meter import Conditions, model_meter
from modt.energy.windows import SCHEMA, Windows

from .simulated import SimulatedMachine, write_files


@pytest.fixture
def machine(tmp_path: Path) -> SimulatedMachine:
    return SimulatedMachine(tmp_path)


def fresh(machine: SimulatedMachine) -> Windows:
    meters = find_powercap(machine.sys)[0].meters
    return Windows(meters, machine.clocks, Conditions(0, machine.sys))


def windows_of(machine: SimulatedMachine) -> Windows:
    """Windows over the machine's counter, after the first window, which has no earlier reading."""
    windows = fresh(machine)
    machine.wait(0.1)
    assert windows.close()["marks"] == ["first"]
    return windows


def second(machine: SimulatedMachine, ledger: Ledger, windows: Windows, frame: int = 0) -> dict[str, Any]:
    """Work for a second, as one frame that fills one window."""
    ledger.run("segmentation", machine.work, 0.25, 0.5, 3)
    machine.wait(0.75)
    line = windows.add(ledger.close_frame(frame))
    assert line is not None
    return line


def test_window_has_its_energy_and_counts(machine: SimulatedMachine) -> None:
    ledger, windows = machine.ledger(), windows_of(machine)
    line = second(machine, ledger, windows, frame=7)
    assert line["schema"] == SCHEMA
    assert line["frames"] == [7, 7, 1]
    assert line["energy_J"] == pytest.approx(3.0 + 0.5, abs=2 * 61e-6)
    assert line["kind"] == "measured"
    assert line["stages"]["segmentation"] == {
        "calls": 1,
        "items": 3,
        "points": 0,
        "wall_ns": 250_000_000,
        "cpu_ns": 250_000_000,
    }
    assert line["process_ns"] == 250_000_000
    assert line["conditions"] == {"governor": "performance", "frequency_MHz": 2600.0, "temperature_C": None}
    assert line["marks"] == []


def test_window_closes_after_a_second(machine: SimulatedMachine) -> None:
    ledger, windows = machine.ledger(), windows_of(machine)
    machine.wait(0.9)
    assert windows.add(ledger.close_frame(0)) is None
    machine.wait(0.1)
    line = windows.add(ledger.close_frame(1))
    assert line is not None
    assert line["frames"] == [0, 1, 2]


def test_lost_meter_is_marked_and_resumes(machine: SimulatedMachine) -> None:
    ledger, windows = machine.ledger(), windows_of(machine)
    second(machine, ledger, windows)
    machine.vanish()
    lost = [second(machine, ledger, windows) for _ in range(2)]
    machine.appear()
    back, good = second(machine, ledger, windows), second(machine, ledger, windows)
    assert [(line["energy_J"], line["kind"], line["marks"]) for line in lost] == [(None, "unavailable", ["lost"])] * 2
    assert (back["energy_J"], back["marks"]) == (None, ["back"])
    assert good["energy_J"] == pytest.approx(3.5, abs=1e-3)


def test_window_of_a_suspension_has_no_energy(machine: SimulatedMachine) -> None:
    ledger, windows = machine.ledger(), windows_of(machine)
    second(machine, ledger, windows)
    machine.suspend(3600.0)
    line = second(machine, ledger, windows)
    assert line["energy_J"] is None
    assert "suspended" in line["marks"]
    assert second(machine, ledger, windows)["energy_J"] == pytest.approx(3.5, abs=1e-3)


def test_power_is_integrated_between_edges(tmp_path: Path) -> None:
    machine = SimulatedMachine(tmp_path)
    rail = write_files(tmp_path / "class" / "hwmon" / "hwmon0", name="ina226", power1_input=4_000_000, in1_input=5000,
                       curr1_input=800)  # fmt: skip
    windows = Windows(find_hwmon(tmp_path)[0].meters, machine.clocks, Conditions(0, tmp_path))
    ledger = machine.ledger()
    (rail / "power1_input").write_text("6000000\n")
    line = second(machine, ledger, windows)
    assert (line["energy_J"], line["kind"]) == (pytest.approx(5.0), "integrated")
    (rail / "power1_input").write_text("-20000\n")
    line = second(machine, ledger, windows)
    assert (line["energy_J"], line["kind"], line["marks"]) == (None, "unavailable", ["negative"])


def test_without_a_meter_energy_is_unavailable(machine: SimulatedMachine) -> None:
    windows = Windows((), machine.clocks, Conditions(0, machine.sys))
    line = second(machine, machine.ledger(), windows)
    assert (line["energy_J"], line["kind"]) == (None, "unavailable")


@settings(max_examples=40)
@given(st.lists(st.tuples(st.floats(0, 0.6), st.floats(0, 0.6), st.integers(0, 4)), max_size=8))
def test_parts_of_every_window_sum_to_it(tmp_path_factory: Any, frames: list[tuple[float, float, int]]) -> None:
    machine = SimulatedMachine(tmp_path_factory.mktemp("sys"))
    ledger, windows = machine.ledger(), fresh(machine)
    start, lines = machine.now_ns, []
    for index, (busy, idle, items) in enumerate(frames):
        ledger.run("tracking", machine.work, busy, busy, items)
        machine.wait(idle)
        lines.append(windows.add(ledger.close_frame(index)))
    lines.append(windows.close())
    closed = [line for line in lines if line is not None]
    for line in closed:
        spans = sum(row["wall_ns"] for row in line["stages"].values())
        assert spans + line["overhead_ns"] + line["idle_ns"] == line["wall_ns"]
        assert line["idle_ns"] >= 0
    assert sum(line["wall_ns"] for line in closed) == machine.now_ns - start
    assert sum(line["frames"][2] for line in closed) == len(frames)
    assert [line["window"] for line in closed] == list(range(len(closed)))


def test_the_first_window_of_a_counter_is_short(machine: SimulatedMachine) -> None:
    """A counter's reading is judged by the power measured before. A power sample needs no earlier one."""
    ledger, windows = machine.ledger(), fresh(machine)
    machine.wait(0.1)
    line = windows.add(ledger.close_frame(0))
    assert line is not None
    assert (line["energy_J"], line["marks"]) == (None, ["first"])
    machine.wait(0.1)
    assert windows.add(ledger.close_frame(1)) is None


def test_a_window_is_as_reliable_as_its_least_reliable_meter(machine: SimulatedMachine) -> None:
    counter = find_powercap(machine.sys)[0].meters[0]
    model = model_meter(3.0, 7.0, machine.clocks.monotonic_ns, machine.clocks.process_ns)
    windows = Windows((counter, model), machine.clocks, Conditions(0, machine.sys))
    for _ in range(2):
        machine.wait(1.0)
        line = windows.close()
    assert (line["energy_J"], line["kind"]) == (pytest.approx(6.0, abs=1e-3), "estimated")
