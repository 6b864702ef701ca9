"""Trained layers between the tools that train and the one that exports."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modt.types import Float32

Layer = tuple[Float32, Float32]
"""(in, out) weight and (out,) bias."""


def save_layers(path: Path, layers: Sequence[tuple[NDArray[Any], NDArray[Any]]]) -> None:
    """Write them."""
    table: dict[str, Float32] = {}
    for i, (weight, bias) in enumerate(layers):
        table |= {f"weight{i}": weight.astype(np.float32), f"bias{i}": bias.astype(np.float32)}
    np.savez(path, **table)


def load_layers(path: Path) -> list[Layer]:
    """Read them again."""
    with np.load(path) as file:
        return [(file[f"weight{i}"], file[f"bias{i}"]) for i in range(len(file.files) // 2)]
