"""Use of the extra `view`: import of its libraries (Matplotlib, Jinja and Pillow), and pages as files."""

from __future__ import annotations

import atexit
import logging
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

from modt.errors import MisuseError, install
from modt.sinks.output import writing
from modt_profiling.reporting.document import Page

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
def _keep_cache_in_memory() -> None:
    """Let Matplotlib keep its list of fonts as long as this process: a command writes only what was asked for."""
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # its notes on fonts are no warnings of a run
    if "MPLCONFIGDIR" in os.environ:
        return
    folder = mkdtemp(prefix="modt-", dir=MEMORY if MEMORY.is_dir() else None)
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    os.environ["MPLCONFIGDIR"] = folder


def save(path: Path, page: Page) -> None:
    """Write a page as HTML.

    Raises:
        MisuseError: a library of the extra is not installed.
        ModtError: the page cannot be written.
    """
    with importing(path):
        from modt_profiling.reporting.html_page import html

        text = html(page)  # plots need Matplotlib
    with writing(path):
        path.write_text(text, encoding="utf-8")
