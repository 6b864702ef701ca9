import pytest

from modt.energy.ledger import SCHEMA, Ledger, StageWork


class Machine:
    """Wall and CPU clocks [ns] that advance only when something is done."""

    def __init__(self):
        self.wall = self.cpu = 1_000
        self.ledger = Ledger(lambda: self.wall, lambda: self.cpu)

    def work(self, wall, cpu, result=None):
        self.wall += wall
        self.cpu += cpu
        return result


@pytest.fixture
def machine():
    return Machine()


def test_spans_are_timed_and_counted_also_when_the_stage_fails(machine):
    ledger = machine.ledger
    assert ledger.run("tracking", machine.work, 50, 40, [1, 2, 3]) == [1, 2, 3]
    ledger.run("tracking", machine.work, 5, 4)
    ledger.count("tracking", points=7)
    machine.work(100, 10)

    def fail():
        machine.work(30, 20)
        raise ValueError("scan")

    with pytest.raises(ValueError, match="scan"):
        ledger.run("source", fail)
    line = ledger.close_frame(12)
    assert (line.schema, line.frame) == (SCHEMA, 12)
    assert line.stages["tracking"] == StageWork(calls=2, items=3, points=7, wall_ns=55, cpu_ns=44)
    assert line.stages["source"].cpu_ns == 20
    assert (line.wall_ns, line.cpu_ns, line.idle_ns, line.marks) == (185, 74, 100, [])


@pytest.mark.parametrize(("wall", "cpu"), [(-500, 3), (40, -500), (-10_000, -10_000)])
def test_clock_that_steps_back_is_marked_and_never_negative(machine, wall, cpu):
    machine.ledger.run("segmentation", machine.work, 20, 20)
    machine.ledger.run("tracking", machine.work, wall, cpu)
    line = machine.ledger.close_frame(0)
    assert line.marks == ["clock"]
    assert min(line.wall_ns, line.cpu_ns, line.idle_ns, line.overhead_ns) >= 0
    assert all(row.wall_ns >= 0 and row.cpu_ns >= 0 for row in line.stages.values())


def test_overhead_is_measured_with_the_clocks_given(machine):
    def ticking():
        machine.cpu += 10
        return machine.cpu

    ledger = Ledger(lambda: machine.wall, ticking)
    for _ in range(2):
        ledger.run("tracking", machine.work, 100, 100)
    machine.work(1_000, 0)
    assert ledger.close_frame(0).overhead_ns == 3 * 20  # of two spans and the frame
