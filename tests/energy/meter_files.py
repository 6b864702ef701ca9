"""Files of meters as the kernel writes them, and windows."""

from pathlib import Path
from typing import Any

from modt.config import EnergyConfig
from modt.energy.ledger import StageWork
from modt.energy.windows import EnergyWindow
from tests.results import energy_window

RANGE_UJ = 262_143_328_850


def write_zone(path: Path, name: str, wrap_uJ: int | None = RANGE_UJ, energy_uJ: int = 1000) -> None:
    """Write a powercap zone as the kernel does."""
    ranges = {} if wrap_uJ is None else {"max_energy_range_uj": wrap_uJ}
    write_files(path, name=name, energy_uj=energy_uJ, **ranges)


def write_files(folder: Path, **contents: object) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in contents.items():
        (folder / name).write_text(f"{content}\n")
    return folder


CALIBRATED = EnergyConfig(idle_W=3.0, seg_J=0.1, class_J=0.01, point_J=1e-3)


def window_of(energy_J: float | None, frames: int, load: int = 0, **changes: Any) -> EnergyWindow:
    """A window of a second of so many frames, with `load` classifications of nine points each."""
    stages = {
        "segmentation": StageWork(calls=frames, cpu_ns=300_000_000),
        "classification": StageWork(calls=frames, items=load, points=9 * load, cpu_ns=100_000_000),
    }
    return energy_window(energy_J, frames, process_ns=500_000_000, stages=stages, **changes)
