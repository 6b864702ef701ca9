"""A simulated machine that draws power. Its clocks advance with its work, and its sysfs files with its clocks."""

from pathlib import Path
from typing import Any

import numpy as np

from modt.config import EnergyConfig
from modt.energy.ledger import Ledger
from modt.energy.windows import Clocks


class SimulatedMachine:
    """Machine that counts energy in a powercap file as hardware does, in steps and with overflow."""

    def __init__(
        self, sys: Path, idle_W: float = 3.0, wrap_uJ: int = 262_143_328_850, step_uJ: float = 61.035, seed: int = 0
    ) -> None:
        self.sys, self.idle_W, self.wrap_uJ, self.step_uJ = sys, idle_W, wrap_uJ, step_uJ
        self.random = np.random.default_rng(seed)
        self.true_J = float(self.random.uniform(0, 1e-6 * wrap_uJ))
        self.now_ns = self.cpu_ns = 1_000_000_000
        self.slept_ns = 0
        self.zone = sys / "class" / "powercap" / "intel-rapl:0"
        write_zone(self.zone, "package-0", wrap_uJ)
        self.cpufreq = sys / "devices" / "system" / "cpu" / "cpu0" / "cpufreq"
        self.cpufreq.mkdir(parents=True)
        (self.cpufreq / "scaling_governor").write_text("performance\n")
        (self.cpufreq / "scaling_cur_freq").write_text("2600000\n")
        self._show()

    @property
    def clocks(self) -> Clocks:
        return Clocks(
            monotonic_ns=lambda: self.now_ns,
            boot_ns=lambda: self.now_ns + self.slept_ns,
            process_ns=lambda: self.cpu_ns,
        )

    def ledger(self) -> Ledger:
        return Ledger(lambda: self.now_ns, lambda: self.cpu_ns)

    def work(self, seconds: float, joules: float, items: int = 0) -> range:
        """Compute for a while. The energy comes on top of the idle power and shows after the next wait."""
        self.cpu_ns += round(seconds * 1e9)
        self.true_J += joules
        self._pass(seconds)
        return range(items)

    def wait(self, seconds: float) -> None:
        self._pass(seconds)
        self._show()

    def _pass(self, seconds: float) -> None:
        self.now_ns += round(seconds * 1e9)
        self.true_J += self.idle_W * seconds

    def suspend(self, seconds: float) -> None:
        self.slept_ns += round(seconds * 1e9)

    def vanish(self) -> None:
        self.zone.rename(self.zone.with_name("gone"))

    def appear(self) -> None:
        self.zone.with_name("gone").rename(self.zone)
        self._show()

    def _show(self) -> None:
        if self.zone.is_dir():
            steps = np.floor(1e6 * self.true_J / self.step_uJ)
            (self.zone / "energy_uj").write_text(f"{int(steps * self.step_uJ) % self.wrap_uJ}\n")


def write_zone(path: Path, name: str, wrap_uJ: int | None = 262_143_328_850, energy_uJ: int = 1000) -> None:
    """Write a powercap zone as the kernel does."""
    path.mkdir(parents=True, exist_ok=True)
    (path / "name").write_text(f"{name}\n")
    (path / "energy_uj").write_text(f"{energy_uJ}\n")
    if wrap_uJ is not None:
        (path / "max_energy_range_uj").write_text(f"{wrap_uJ}\n")


def write_files(folder: Path, **contents: object) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in contents.items():
        (folder / name).write_text(f"{content}\n")
    return folder


CALIBRATED = EnergyConfig(idle_W=3.0, seg_J=0.1, class_J=0.01, point_J=1e-3)


def line_of(energy_J: float | None, frames: int, load: int = 0, **more: Any) -> dict[str, Any]:
    row = {"calls": frames, "items": 0, "points": 0, "wall_ns": 0, "cpu_ns": 300_000_000}
    stages = {
        "segmentation": row,
        "classification": {**row, "items": load, "points": 9 * load, "cpu_ns": 100_000_000},
    }
    base = {"energy_J": energy_J, "wall_ns": 10**9, "process_ns": 500_000_000, "stages": stages, "marks": []}
    return {**base, "kind": "measured", **more}


def window_of(line: dict[str, Any]) -> dict[str, Any]:
    return line | {"frames": [0, 1, 2], "conditions": {}, "resolution_J": 0.0, "meters": [{"name": "RAPL"}]}
