import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.energy.ledger import SCHEMA, Ledger


class Machine:
    """Wall and CPU clocks that advance only when something is done."""

    def __init__(self) -> None:
        self.wall = self.cpu = 1_000

    def wall_ns(self) -> int:
        return self.wall

    def cpu_ns(self) -> int:
        return self.cpu

    def work(self, wall: int, cpu: int, result: object = None) -> object:
        self.wall += wall
        self.cpu += cpu
        return result


@pytest.fixture
def machine() -> Machine:
    return Machine()


@pytest.fixture
def ledger(machine: Machine) -> Ledger:
    return Ledger(machine.wall_ns, machine.cpu_ns)


def test_spans_are_timed_and_counted(ledger: Ledger, machine: Machine) -> None:
    assert ledger.run("tracking", machine.work, 50, 40, [1, 2, 3]) == [1, 2, 3]
    ledger.run("tracking", machine.work, 5, 4)
    ledger.count("tracking", points=7, items=1)
    machine.work(100, 10)
    line = ledger.close_frame(12)
    assert line["schema"] == SCHEMA
    assert line["frame"] == 12
    assert line["stages"] == {"tracking": {"calls": 2, "items": 4, "points": 7, "wall_ns": 55, "cpu_ns": 44}}
    assert (line["wall_ns"], line["cpu_ns"], line["idle_ns"], line["marks"]) == (155, 54, 100, [])


def test_failing_stage_is_timed_and_its_error_propagates(ledger: Ledger, machine: Machine) -> None:
    def fail() -> None:
        machine.work(30, 20)
        raise ValueError("scan")

    with pytest.raises(ValueError, match="scan"):
        ledger.run("source", fail)
    assert ledger.close_frame(0)["stages"]["source"]["cpu_ns"] == 20


@pytest.mark.parametrize(("wall", "cpu"), [(-500, 3), (40, -500), (-10_000, -10_000)])
def test_clock_that_steps_back_is_marked_and_never_negative(
    ledger: Ledger, machine: Machine, wall: int, cpu: int
) -> None:
    ledger.run("segmentation", machine.work, 20, 20)
    ledger.run("tracking", machine.work, wall, cpu)
    line = ledger.close_frame(0)
    assert line["marks"] == ["clock"]
    assert min(line["wall_ns"], line["cpu_ns"], line["idle_ns"], line["overhead_ns"]) >= 0
    assert all(row["wall_ns"] >= 0 and row["cpu_ns"] >= 0 for row in line["stages"].values())


stage_work = st.tuples(
    st.sampled_from(["source", "tracking", "sink"]), st.integers(0, 10**9), st.integers(0, 10**9), st.integers(0, 9)
)


@given(st.lists(st.lists(stage_work, max_size=6), max_size=4), st.integers(0, 300))
def test_parts_sum_to_the_frame(frames: list[list[tuple[str, int, int, int]]], tick: int) -> None:
    machine = Machine()

    def ticking() -> int:
        machine.wall += tick
        return machine.wall

    ledger = Ledger(ticking, machine.cpu_ns)
    start = machine.wall
    total = 0
    for index, works in enumerate(frames):
        for stage, wall, cpu, items in works:
            ledger.run(stage, machine.work, wall, cpu, range(items))
        line = ledger.close_frame(index)
        spans = sum(row["wall_ns"] for row in line["stages"].values())
        assert spans + line["overhead_ns"] + line["idle_ns"] == line["wall_ns"]
        assert min(line["overhead_ns"], line["idle_ns"]) >= 0
        assert line["marks"] == []
        total += line["wall_ns"]
    assert total == machine.wall - start if frames else total == 0


def test_overhead_is_measured_with_the_clocks_given(machine: Machine) -> None:
    reads = 0

    def ticking() -> int:
        nonlocal reads
        reads += 1
        machine.cpu += 10
        return machine.cpu

    ledger = Ledger(machine.wall_ns, ticking)
    assert ledger.span_overhead_ns == 20
    assert ledger.frame_overhead_ns == 20
    ledger.run("tracking", machine.work, 100, 100)
    ledger.run("tracking", machine.work, 100, 100)
    machine.work(1_000, 0)
    assert ledger.close_frame(0)["overhead_ns"] == 60
