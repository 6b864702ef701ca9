"""Columns of a table with one row a track."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modt.types.arrays import Int, Self


def column(kind: type, *shape: int, fill: float = 0) -> Any:
    """Column of a track table: type and shape of an entry, and its value in a new row."""
    return field(metadata={"blank": np.full(shape, fill, kind)})


@dataclass(frozen=True)
class Columns:
    """Columns of a track table, one row a track.

    A subclass declares the columns that one stage owns. The owner writes their entries in place; the other stages get
    them read-only, and writing to those raises ValueError. No column is ever replaced by another array.
    """

    def __len__(self) -> int:
        return len(next(iter(vars(self).values())))

    @classmethod
    def blank(cls, m: int = 0) -> Self:
        """M rows without identity, proposal and view, with all classes alike."""
        return cls._made({name: np.repeat(entry[None], m, axis=0) for name, entry in cls._blank_row().items()})

    @classmethod
    def of(cls, table: Columns) -> Self:
        """The columns of this class in a table that has further ones; the arrays are shared."""
        return cls._made({name: getattr(table, name) for name in cls._blank_row()})

    @classmethod
    @cache
    def _blank_row(cls) -> dict[str, NDArray[Any]]:
        return {f.name: f.metadata["blank"] for f in fields(cls)}

    @classmethod
    def _made(cls, columns: dict[str, NDArray[Any]]) -> Self:
        """The table of these columns; the constructor of a frozen dataclass takes several times as long."""
        table = object.__new__(cls)
        vars(table).update(columns)
        return table

    def columns(self) -> dict[str, NDArray[Any]]:
        """Every column by its name."""
        return vars(self).copy()

    def copy(self) -> Self:
        """The same rows, independent of these."""
        return self._made({name: entries.copy() for name, entries in vars(self).items()})

    def renewed(self, kept: Int, n: int) -> Self:
        """The rows kept, by index, then n blank ones."""
        if not len(self):
            return self.blank(n)
        rows = np.concatenate([kept, np.zeros(n, np.int64)])  # room for the blank ones, whatever was there
        columns = {name: entries.take(rows, axis=0) for name, entries in vars(self).items()}
        for name, blank in self._blank_row().items():
            columns[name][len(kept) :] = blank
        return self._made(columns)

    def read_only(self, *parts: type[Columns]) -> Self:
        """The same columns; those of the parts given, by default all, cannot be written to."""
        columns = self.columns()
        for part in parts or (type(self),):
            for name in part._blank_row():
                columns[name] = view = columns[name].view()
                view.setflags(write=False)
        return self._made(columns)

    def lock(self) -> Self:
        """Forbid to write to these columns from here on; returns the table."""
        for entries in vars(self).values():
            entries.setflags(write=False)
        return self
