"""A dataset: folders of Parquet files, one file a run in each, and the request by which it was made.

A run is committed when its file is in `runs/`, which is written last. Files are written under a name that readers
skip, and renamed. So a reader never sees a part of a file, and a stopped batch leaves nothing that counts.
"""

from __future__ import annotations

import json
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import fsspec
from pyarrow import parquet

from modt.errors import MisuseError, ModtError

RUNS = "runs"
TABLES = ("tracks", "ledger", RUNS)
"""Folders of the dataset, in the order in which the files of a run are written."""
REQUEST = "batch.json"
PAGES = "pages"
SUFFIX = ".parquet"
PARTIAL = ".part"


class Dataset:
    """A dataset at a path or an address of fsspec.

    Raises:
        MisuseError: the address is none that fsspec knows here.
    """

    def __init__(self, address: str) -> None:
        self.address = address
        try:
            self._files, self.root = fsspec.core.url_to_fs(address)
        except (ValueError, ImportError) as error:
            raise MisuseError(address, f"cannot be opened ({error})", "give a path or an address of fsspec") from None

    def describe(self, request: Mapping[str, Any]) -> None:
        """Write the request by which the runs are made, or compare it with the one that is there.

        Raises:
            MisuseError: the dataset was made by another request.
            ModtError: it cannot be read or written.
        """
        path = f"{self.root}/{REQUEST}"
        with self._access():
            before = json.loads(self._files.cat_file(path)) if self._files.exists(path) else None
            if before is None:
                self._write(path, json.dumps(request, indent=1).encode())
        if before not in (None, json.loads(json.dumps(request))):
            known = {*request, *(before or {})}
            other = sorted(key for key in known if (before or {}).get(key) != request.get(key))
            raise MisuseError(self.address, f"was made with another {', '.join(other)}", "give another --out")

    def committed(self) -> set[str]:
        """Names of the runs that it holds."""
        names = (path.rpartition("/")[2] for path in self._paths_in(RUNS))
        return {name.removesuffix(SUFFIX) for name in names if name.endswith(SUFFIX) and not name.startswith(".")}

    def commit(self, name: str, files: Mapping[str, Path]) -> None:
        """Add the tables of a run, each a local Parquet file.

        Raises:
            ModtError: they cannot be written.
        """
        for table in TABLES:
            self.put(f"{table}/{name}{SUFFIX}", files[table].read_bytes())

    def put(self, place: str, content: bytes) -> None:
        """Write a file at a place within the dataset.

        Raises:
            ModtError: it cannot be written.
        """
        with self._access():
            self._write(f"{self.root}/{place}", content)

    def remove_unfinished(self) -> None:
        """Remove files that a killed worker was writing. No worker may be at work."""
        for table in (*TABLES, PAGES):
            for path in self._paths_in(table):
                if path.endswith(PARTIAL):
                    with self._access():
                        self._files.rm_file(path)

    def runs(self) -> list[dict[str, Any]]:
        """Rows of the table of runs, in the order of their names."""
        rows = []
        for name in sorted(self.committed()):
            with self._access(), self._files.open(f"{self.root}/{RUNS}/{name}{SUFFIX}", "rb") as file:
                rows += parquet.read_table(file).to_pylist()
        return rows

    def has(self, place: str) -> bool:
        """Whether there is a file at a place within the dataset."""
        with self._access():
            return bool(self._files.exists(f"{self.root}/{place}"))

    def _paths_in(self, folder: str) -> list[str]:
        """Paths of the files in a folder of the dataset, whatever characters its address has."""
        path = f"{self.root}/{folder}"
        with self._access():
            self._files.invalidate_cache(path)
            return list(self._files.ls(path, detail=False)) if self._files.isdir(path) else []

    def _write(self, path: str, content: bytes) -> None:
        folder, _, name = path.rpartition("/")
        partial = f"{folder}/.{name}-{uuid.uuid4().hex[:8]}{PARTIAL}"
        self._files.makedirs(folder, exist_ok=True)
        self._files.pipe_file(partial, content)
        self._files.mv(partial, path)

    @contextmanager
    def _access(self) -> Iterator[None]:
        """Convert a failure of the storage to an error with a remedy."""
        try:
            yield
        except OSError as error:
            raise ModtError(self.address, f"storage fails ({error})", "start the same command again") from None
