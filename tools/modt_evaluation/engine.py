"""Runs a function on many tasks: here, on several cores, or on a Dask cluster."""

from __future__ import annotations

import logging
import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import partial
from multiprocessing import resource_tracker
from types import TracebackType
from typing import Any, TypeVar

from modt import host
from modt.errors import MisuseError, ModtError, install
from modt.types import Self

log = logging.getLogger(__name__)
T = TypeVar("T")
R = TypeVar("R")
CONNECT_S = 20.0
"""Time limit for reaching a scheduler [s]."""


@dataclass(slots=True)
class Engine:
    """Context in which tasks are run. One job without a scheduler runs in this process and needs no Dask.

    Attributes:
        jobs: number of processes of this machine, if no scheduler is given.
        scheduler: address of a Dask scheduler, whose workers have modt and the same files.
        announce: called with a line about the cluster, when the first task needs it.
    """

    jobs: int = 1
    scheduler: str | None = None
    announce: Callable[[str], None] = lambda words: None
    _open: ExitStack = field(default_factory=ExitStack)
    _client: Any = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is KeyboardInterrupt:  # Dask complains of what it was about to do
            for name in ("distributed", "tornado"):
                logging.getLogger(name).setLevel(logging.CRITICAL)
        self._open.close()

    @property
    def local(self) -> bool:
        """Whether the tasks run in this process."""
        return self.jobs == 1 and self.scheduler is None

    def outcomes(self, function: Callable[[T], R], tasks: Sequence[T]) -> Iterator[tuple[T, R | Exception]]:
        """Each task with its result, or the exception that ended it, in the order in which they end.

        Dask gives the task of a lost worker to another one, several times if need be. So the function may run more
        than once for a task.

        Args:
            function: function of a module, which every worker can import.
            tasks: arguments that can be pickled.

        Raises:
            MisuseError: Dask is not installed.
            ModtError: the scheduler cannot be reached.
        """
        if not tasks:
            return
        if self.local:
            for task in tasks:
                yield task, _outcome(function, task)
            return
        if self._client is None:
            self._connect()
        from distributed import as_completed

        futures = self._client.map(partial(_outcome, function), tasks, pure=False)
        task_of = {future.key: task for future, task in zip(futures, tasks, strict=True)}
        ended = as_completed(futures)
        del futures  # Dask forgets a result that nobody refers to
        for future in ended:
            yield task_of.pop(future.key), future.exception() or future.result()

    def results(self, function: Callable[[T], R], tasks: Sequence[T]) -> Iterable[tuple[T, R]]:
        """Outcomes of tasks that have to succeed.

        Raises:
            Exception: as `outcomes`, and that of the first task that fails.
        """
        for task, outcome in self.outcomes(function, tasks):
            if isinstance(outcome, Exception):
                raise outcome
            yield task, outcome

    def _connect(self) -> None:
        """Connect to the scheduler, or start a cluster of processes with one thread each."""
        try:
            from distributed import Client, LocalCluster
        except ModuleNotFoundError as error:
            raise MisuseError("more than one process", f"needs {error.name}", install("batch")) from None
        logging.getLogger("distributed").setLevel(logging.WARNING)
        address: Any = self.scheduler
        if self.scheduler is None:
            host.pin_to_core(None)  # the processes inherit the size of the thread pools
            options = {"dashboard_address": "127.0.0.1:0", "silence_logs": logging.CRITICAL}
            with _without_ctrl_c():
                cluster = LocalCluster(n_workers=self.jobs, threads_per_worker=1, **options)
                address = self._open.enter_context(cluster)
            logging.getLogger("distributed").setLevel(logging.WARNING)  # which the cluster has set for its workers
        try:
            self._client = self._open.enter_context(Client(address, timeout=CONNECT_S))
        except (OSError, ValueError, TimeoutError) as error:
            raise ModtError(self.scheduler, f"no scheduler answers ({error})", "give the address it prints") from None
        self.announce(f"dashboard of the cluster: {self._client.dashboard_link}")


@contextmanager
def _without_ctrl_c() -> Iterator[None]:
    """Context whose processes and threads get no SIGINT, so that this process alone ends them; it waits here."""
    resource_tracker.ensure_running()  # which the first process would start, and which lets SIGINT through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _outcome(function: Callable[[T], R], task: T) -> R | Exception:
    """The result, or the exception. One that might not cross to another process becomes its text."""
    try:
        return function(task)
    except ModtError as error:
        return error
    except Exception as error:
        log.exception("a task failed")
        return RuntimeError(f"{type(error).__name__}: {error}")
