"""Pages of `modt view`, read back."""

import base64
import json
import re
import zlib
from pathlib import Path

import numpy as np

from modt.viewer.packed import CELL_BYTES, LEVELS, NUMBER_BYTES


def unpacked(text: str) -> np.ndarray:
    """Bytes of a packed text."""
    return np.frombuffer(zlib.decompress(base64.b64decode(text)), np.uint8)


def sums(data: np.ndarray, n_bytes: int) -> np.ndarray:
    """Numbers from the byte planes of their differences, summed modulo 2^32 as in the page."""
    parts = data.reshape(n_bytes, -1).astype(np.int64)
    total = np.cumsum(sum(part << (8 * k) for k, part in enumerate(parts)))
    return (total + 2**31) % 2**32 - 2**31


def cells(text: str) -> tuple[np.ndarray, np.ndarray]:
    """Numbers and levels of the cells of a sweep."""
    number, level, _ = looks(text)
    return number, level


def looks(text: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Numbers, levels and groups of the cells of a sweep."""
    data = unpacked(text)
    n = len(data) // (CELL_BYTES + 1)
    group, level = np.divmod(data[CELL_BYTES * n :].astype(np.int64), LEVELS)
    return sums(data[: CELL_BYTES * n], CELL_BYTES), level, group


def table(text: str, n_columns: int) -> np.ndarray:
    """(R, n_columns) table."""
    return np.stack([sums(column, NUMBER_BYTES) for column in unpacked(text).reshape(n_columns, -1)], axis=1)


class Page:
    """Contents of a page."""

    def __init__(self, path: Path) -> None:
        self.text = path.read_text(encoding="utf-8")
        found = dict(re.findall(r'<script type="[^"]+" id="([^"]+)">([^<]*)</script>', self.text))
        self.run = json.loads(found["run"])
        self.tracks = table(found["tracks"], len(self.run["columns"]))
        self.points = [cells(text) for name, text in found.items() if name.startswith("points-")]

    def column(self, name: str) -> np.ndarray:
        """A column of the tracks."""
        return self.tracks[:, [column for column, _ in self.run["columns"]].index(name)]
