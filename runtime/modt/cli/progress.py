"""A progress bar on a terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from modt.errors import install


@contextmanager
def bar(total: int | None, unit: str, *, shown: bool) -> Iterator[Callable[[str], None]]:
    """Yield a function that is called with a few words after every unit. It has no effect unless `shown`."""
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
