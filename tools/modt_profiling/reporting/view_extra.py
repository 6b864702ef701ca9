"""Import of the libraries of the extra `view`: Matplotlib, Jinja and Pillow."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from modt.errors import MisuseError, install

MEMORY = Path("/dev/shm")
"""File system in memory."""


@contextmanager
def importing(subject: object) -> Iterator[None]:
    """Context in which modules that use the extra are imported, for a file or an option.

    Raises:
        MisuseError: one of its libraries is not installed.
    """
    _keep_cache_in_memory()
    try:
        yield
    except ModuleNotFoundError as error:
        raise MisuseError(subject, f"needs {error.name}", install("view")) from None


@cache
def _keep_cache_in_memory() -> TemporaryDirectory[str] | None:
    """Let Matplotlib keep its list of fonts as long as this process: a command writes only what was asked for."""
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # its notes on fonts are no warnings of a run
    if "MPLCONFIGDIR" in os.environ:
        return None
    folder = TemporaryDirectory(prefix="modt-", dir=MEMORY if MEMORY.is_dir() else None)
    os.environ["MPLCONFIGDIR"] = folder.name
    return folder
