"""A progress bar on a terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from modt.types import FrameResult

Tick = Callable[[FrameResult], None]


@contextmanager
def progress(total: int | None, *, shown: bool) -> Iterator[Tick]:
    """Function to call after every frame; without effect unless shown."""
    if not shown:
        yield lambda result: None
        return
    try:
        from tqdm import tqdm
    except ImportError:
        print("modt: no progress bar; pip install 'modt[progress]' to see one", file=sys.stderr)
        yield lambda result: None
        return
    tqdm.monitor_interval = 0  # its monitor would be a second thread
    with tqdm(total=total, unit="frame", file=sys.stderr, leave=False, dynamic_ncols=True) as bar:

        def tick(result: FrameResult) -> None:
            bar.set_postfix_str(
                f"{len(result.proposals)} proposals, {len(result.classified)} classified", refresh=False
            )
            bar.update()

        yield tick
