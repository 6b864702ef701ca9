"""Progress of a long command: a bar on a terminal, else a line each LINE_S."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from modt.errors import install

LINE_S = 10.0
"""Least time from the start to the first line, and between two lines [s]."""
_LINE = "{n_fmt} of {total_fmt} {unit}s, {elapsed}, {remaining} left{postfix}"
_ENDLESS_LINE = "{n_fmt} {unit}s, {elapsed}{postfix}"


@contextmanager
def bar(total: int | None, unit: str, *, shown: bool) -> Iterator[Callable[[str], None]]:
    """Yield a function that is called with a few words after every unit. It has no effect unless `shown`."""
    terminal = sys.stderr.isatty()
    if not shown:
        yield lambda words: None
        return
    try:
        from tqdm import tqdm
    except ImportError:
        if terminal:
            print(f"modt: no progress bar; {install('progress')}", file=sys.stderr)
        yield lambda words: None
        return
    tqdm.monitor_interval = 0  # its monitor would be a second thread
    look: dict[str, Any] = {"file": sys.stderr, "dynamic_ncols": True}
    if not terminal:
        line = _ENDLESS_LINE if total is None else _LINE
        look = {"file": _Lines(), "bar_format": line, "delay": LINE_S, "mininterval": LINE_S, "miniters": 1}
    with tqdm(total=total, unit=unit, leave=False, **look) as drawn:

        def step(words: str) -> None:
            drawn.set_postfix_str(words, refresh=False)
            drawn.update()

        yield step


class _Lines:
    """File for tqdm that writes each state of the bar as a line of stderr."""

    def write(self, text: str) -> None:
        """Write a state; tqdm also writes blanks to delete one."""
        state = text.strip()
        if state:
            print(f"modt: {state}", file=sys.stderr, flush=True)

    def flush(self) -> None:
        """Do nothing, because every line is flushed."""
