"""Files of trained layers, written by the training tools and read by the export."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Layer = tuple[NDArray[Any], NDArray[Any]]
"""(in, out) weight and (out,) bias."""


def save_layers(path: Path, layers: Sequence[Layer]) -> None:
    """Write layers as float32."""
    table: dict[str, Any] = {}
    for i, (weight, bias) in enumerate(layers):
        table |= {f"weight{i}": weight.astype(np.float32), f"bias{i}": bias.astype(np.float32)}
    np.savez(path, **table)


def load_layers(path: Path) -> list[Layer]:
    """Read the layers of a file."""
    with np.load(path) as file:
        return [(file[f"weight{i}"], file[f"bias{i}"]) for i in range(len(file.files) // 2)]
