"""Results on disk by the hash of all that they follow from."""

from __future__ import annotations

import hashlib
import io
import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modt.errors import ModtError

Arrays = Mapping[str, NDArray[Any]]
NO_EFFECT = (
    *(f"{part}/" for part in ("cli", "energy/meters", "reporting", "ros2", "service", "sinks", "viewer")),
    *(f"experiments/{part}" for part in ("catalogue/", "output/", "paper.py", "study.py", "units.py")),
)
"""Parts of the package that no result follows from."""


@dataclass(frozen=True, slots=True)
class Store:
    """A folder of arrays by key; what is broken there counts as missing."""

    folder: Path

    def get(self, key: str) -> Arrays | None:
        """The arrays of a key."""
        try:
            with self._path(key).open("rb") as file, np.load(file, allow_pickle=False) as found:
                return {name: found[name] for name in found.files}
        except Exception:  # of a dozen kinds: the file system's, zipfile's, zlib's, NumPy's
            return None

    def has(self, key: str) -> bool:
        """Whether there are arrays of a key."""
        return self._path(key).is_file()

    def put(self, key: str, packed: bytes) -> None:
        """Keep packed arrays.

        Raises:
            ModtError: they cannot be written.
        """
        path = self._path(key)
        part = path.with_suffix(f".{os.getpid()}.part")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            part.write_bytes(packed)
            part.replace(path)
        except OSError as error:
            raise ModtError(path, f"cannot be written ({error.strerror or error})", "free the disk") from None

    def made(self, key: str, make: Callable[[], Arrays]) -> Arrays:
        """The arrays of a key, made where they are missing."""
        found = self.get(key)
        if found is None:
            found = make()
            self.put(key, packed(found, compressed=False))
        return found

    def _path(self, key: str) -> Path:
        return self.folder / key[:2] / f"{key}.npz"


def packed(arrays: Arrays, *, compressed: bool = True) -> bytes:
    """The arrays as the bytes of a .npz file."""
    out = io.BytesIO()
    write: Callable[..., None] = np.savez_compressed if compressed else np.savez
    write(out, **arrays)
    return out.getvalue()


def key_of(*parts: Any) -> str:
    """Hash of plain data, and of the code."""
    text = json.dumps([code_digest(), *parts], sort_keys=True)
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


@cache
def code_digest() -> str:
    """Of the files of the package that results follow from."""
    return _digest(lambda place: not place.startswith(NO_EFFECT))


@cache
def catalogue_digest() -> str:
    """Of the files that figures follow from, given results."""
    return _digest(lambda place: place.startswith("experiments/"))


def _digest(counts: Callable[[str], bool]) -> str:
    root, found = Path(__file__).parents[1], hashlib.blake2b(digest_size=16)
    for path in sorted(root.rglob("*")):
        place = path.relative_to(root).as_posix()
        if path.suffix in (".py", ".c", ".so") and counts(place):
            found.update(place.encode() + path.read_bytes())
    return found.hexdigest()
