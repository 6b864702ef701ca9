"""The energy of a run, summed over its windows or modelled frames."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

from modt.config import EnergyConfig
from modt.energy.attribution import attribute, usable
from modt.energy.ledger import LedgerLine
from modt.energy.meters.meter import Kind, Scope, model_J, model_name, worst
from modt.energy.windows import EnergyWindow, MeterEnergy


def modelled(line: LedgerLine, board: EnergyConfig) -> EnergyWindow:
    """A frame's ledger line as a window of one frame, with the energy of the power model."""
    energy_J = model_J(board, line.wall_ns, line.cpu_ns)
    return EnergyWindow(
        window=line.frame,
        frames=(line.frame, line.frame, 1),
        wall_ns=line.wall_ns,
        process_ns=line.cpu_ns,
        overhead_ns=line.overhead_ns,
        idle_ns=line.idle_ns,
        stages=line.stages,
        energy_J=energy_J,
        kind=Kind.ESTIMATED,
        resolution_J=0.0,
        meters=[MeterEnergy(model_name(board), Kind.ESTIMATED, Scope.PROCESS, energy_J)],
        conditions={},
        marks=line.marks,
    )


class EnergySums:
    """Energy of windows or of modelled frames, summed."""

    def __init__(self, board: EnergyConfig) -> None:
        self._board = board
        self.count = 0
        self.dropped = 0  # windows that are not usable
        self.frames = 0
        self.wall_ns = 0
        self.gross_J = 0.0
        self.error2_J2 = 0.0  # sum of the squared resolutions
        self.parts_J: Counter[str] = Counter()
        self._cpu_ns: Counter[str] = Counter()  # CPU time of each stage
        self.kind = Kind.ESTIMATED
        self.meter = ""
        self.conditions: Mapping[str, Any] = {}  # conditions of the last window
        self.marks: set[str] = set()

    def add_window(self, window: EnergyWindow) -> None:
        """Add a line of modt.energy; one that is not usable is counted as dropped."""
        self.conditions = window.conditions
        self.marks.update(window.marks)
        if not usable(window):
            self.dropped += 1
            if window.energy_J is not None and not window.marks:
                self.marks.add("implausible")
        elif window.n_frames:
            self.add(window)

    def watts(self, *stages: str) -> float:
        """Power above idling while the stages compute: their energy over their CPU time; NaN where it has no part."""
        ran = [stage for stage in stages if self._cpu_ns[stage]]
        joules = sum(self.parts_J.get(stage, math.nan) for stage in ran)
        return 1e9 * joules / sum(self._cpu_ns[stage] for stage in ran) if ran else 0.0

    def stage_watts(self, stages: Iterable[str]) -> dict[str, float]:
        """Power of each of these stages as by `watts` [W]; stages without a part of the energy are left out."""
        return {stage: watts for stage in stages if not math.isnan(watts := self.watts(stage))}

    def add(self, window: EnergyWindow) -> None:
        """Add the energy of a window, or of a modelled frame."""
        assert window.energy_J is not None
        self.kind = worst([window.kind, *([self.kind] if self.count else [])])
        self.meter = self.meter or window.meters[0].name
        self.count += 1
        self.frames += window.n_frames
        self.wall_ns += window.wall_ns
        self.gross_J += window.energy_J
        self.error2_J2 += window.resolution_J**2
        self.parts_J.update(attribute(window, self._board))
        self._cpu_ns.update({stage: work.cpu_ns for stage, work in window.stages.items()})


def run_energy(windows: Iterable[EnergyWindow], frames: Iterable[LedgerLine], board: EnergyConfig) -> EnergySums:
    """Energy of a run: the energy of its windows if a meter was read, else that of its frames by the power model."""
    sums = EnergySums(board)
    for window in windows:
        sums.add_window(window)
    if not sums.count:
        for line in frames:
            sums.add(modelled(line, board))
    return sums
