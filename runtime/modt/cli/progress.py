"""A progress bar on a terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from modt.errors import install

if TYPE_CHECKING:  # NumPy is imported once the process is pinned
    from modt.types import FrameResult

Tick = Callable[["FrameResult"], None]


@contextmanager
def progress(total: int | None, *, shown: bool) -> Iterator[Tick]:
    """Function to call after every frame; without effect unless shown."""
    with bar(total, "frame", shown=shown) as step:
        yield lambda result: step(f"{len(result.proposals)} proposals, {len(result.classified)} classified")


@contextmanager
def bar(total: int | None, unit: str, *, shown: bool) -> Iterator[Callable[[str], None]]:
    """Function to call with a few words after every unit; without effect unless shown."""
    if not shown:
        yield lambda words: None
        return
    try:
        from tqdm import tqdm
    except ImportError:
        print(f"modt: no progress bar; {install('progress')}", file=sys.stderr)
        yield lambda words: None
        return
    tqdm.monitor_interval = 0  # its monitor would be a second thread
    with tqdm(total=total, unit=unit, file=sys.stderr, leave=False, dynamic_ncols=True) as drawn:

        def step(words: str) -> None:
            drawn.set_postfix_str(words, refresh=False)
            drawn.update()

        yield step
