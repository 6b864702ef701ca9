"""A simulated machine that draws power. Its clocks advance with its work, and its sysfs files with its clocks."""

from pathlib import Path
from typing import Any

from modt.config import EnergyConfig
from modt.energy.windows import Clocks

RANGE_UJ, STEP_UJ, IDLE_W = 262_143_328_850, 61.035, 3.0


class SimulatedMachine:
    """Machine that counts energy in a powercap file as hardware does, in steps and with overflow."""

    def __init__(self, sys: Path) -> None:
        self.sys, self.true_J = sys, 1e-6 * RANGE_UJ - 7.0
        self.now_ns = self.cpu_ns = 1_000_000_000
        self.slept_ns = 0
        self.zone = sys / "class" / "powercap" / "intel-rapl:0"
        write_zone(self.zone, "package-0")
        cpufreq = sys / "devices" / "system" / "cpu" / "cpu0" / "cpufreq"
        write_files(cpufreq, scaling_governor="performance", scaling_cur_freq=2600000)
        self._show()

    @property
    def clocks(self) -> Clocks:
        return Clocks(
            monotonic_ns=lambda: self.now_ns,
            boot_ns=lambda: self.now_ns + self.slept_ns,
            process_ns=lambda: self.cpu_ns,
        )

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
        self.true_J += IDLE_W * seconds

    def suspend(self, seconds: float) -> None:
        self.slept_ns += round(seconds * 1e9)

    def vanish(self) -> None:
        self.zone.rename(self.zone.with_name("gone"))

    def appear(self) -> None:
        self.zone.with_name("gone").rename(self.zone)
        self._show()

    def _show(self) -> None:
        if self.zone.is_dir():
            steps = int(1e6 * self.true_J / STEP_UJ)
            (self.zone / "energy_uj").write_text(f"{int(steps * STEP_UJ) % RANGE_UJ}\n")


def write_zone(path: Path, name: str, wrap_uJ: int | None = RANGE_UJ, energy_uJ: int = 1000) -> None:
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
