"""A thread that writes what the loop must not wait for."""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Callable

from modt.errors import ModtError

log = logging.getLogger(__name__)

CAPACITY = 128
"""Jobs that wait at most."""
Job = Callable[[], None]


class JobThread:
    """Runs jobs in their order; a job that does not fit into the queue is refused.

    Attributes:
        refused: jobs.
    """

    def __init__(self, name: str = "writer", capacity: int = CAPACITY) -> None:
        self.refused, self._capacity = 0, capacity
        self._jobs: deque[Job] = deque()
        self._changed = threading.Condition()
        self._ended = self._failed = False
        self._thread = threading.Thread(target=self._work, name=name, daemon=True)
        self._thread.start()

    def submit(self, job: Job) -> bool:
        """Whether the job will be run."""
        with self._changed:
            fits = len(self._jobs) < self._capacity and not self._ended
            if fits:
                self._jobs.append(job)
                self._changed.notify()
            else:
                self.refused += 1
        return fits

    def close(self, timeout_s: float = 0.5) -> bool:
        """Run what waits; whether all of it was done within the timeout."""
        with self._changed:
            self._ended = True
            self._changed.notify()
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _work(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._jobs or self._ended)
                if not self._jobs:
                    return
                job = self._jobs.popleft()
            try:
                job()
            except Exception as error:
                if not self._failed:
                    self._failed = True
                    known = isinstance(error, ModtError)
                    what = f"{error}" if known else f"{type(error).__name__}: {error}"
                    log.error("writer: %s; later ones are only counted", what, exc_info=None if known else error)
