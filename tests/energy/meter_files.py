"""Files of meters as the kernel writes them, and lines of windows."""

from pathlib import Path
from typing import Any

from modt.config import EnergyConfig

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


def line_of(energy_J: float | None, frames: int, load: int = 0, **more: Any) -> dict[str, Any]:
    row = {"calls": frames, "items": 0, "points": 0, "wall_ns": 0, "cpu_ns": 300_000_000}
    stages = {
        "segmentation": row,
        "classification": {**row, "items": load, "points": 9 * load, "cpu_ns": 100_000_000},
    }
    base = {"energy_J": energy_J, "wall_ns": 10**9, "process_ns": 500_000_000, "stages": stages, "marks": []}
    return {**base, "kind": "measured", **more}
