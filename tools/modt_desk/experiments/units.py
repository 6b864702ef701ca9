"""Units of work: a drive replayed in one way, here, in several processes or on a cluster."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from multiprocessing import get_context, parent_process
from pathlib import Path
from threading import Thread
from typing import Any, Protocol

from modt.errors import MisuseError, ModtError
from modt_desk.experiments.drives import Drive
from modt_desk.experiments.replays import Replay
from modt_desk.experiments.store import Store, code_digest, key_of, packed


@dataclass(frozen=True, slots=True)
class Unit:
    """A drive replayed in one way.

    Attributes:
        drive, digest: what is replayed.
        replay: how.
        code: digest of the code that asked.
        basis: hash of what it has in common with other units of the drive.
        key: hash of all that the outcome follows from.
    """

    drive: Drive
    digest: str
    replay: Replay
    code: str
    basis: str
    key: str

    @classmethod
    def of(cls, drive: Drive, digest: str, replay: Replay) -> Unit:
        """With its key."""
        basis, key = (key_of(digest, part) for part in (replay.basis(), replay.described()))
        return cls(drive, digest, replay, code_digest(), basis, key)


def work(unit: Unit, folder: Path) -> bytes:
    """The outcome, packed; what units share is kept in a folder of the worker's.

    Raises:
        MisuseError: the worker has another version of the code, or lacks the drive.
    """
    if unit.code != code_digest():
        raise MisuseError("a worker", "runs another version of modt", "install the same one there, and restart it")
    return packed(unit.replay.judged(unit.drive, unit.digest, Store(folder)).arrays())


class Executor(Protocol):
    """Where units are worked off."""

    def outcomes(self, units: Sequence[Unit], folder: Path) -> Iterator[tuple[Unit, bytes]]:
        """Each with its outcome, as it is ready."""


class Here:
    """In this process, one after another."""

    def outcomes(self, units: Sequence[Unit], folder: Path) -> Iterator[tuple[Unit, bytes]]:
        """In their order."""
        for unit in units:
            yield unit, work(unit, folder)


@dataclass(frozen=True, slots=True)
class Processes:
    """Several processes of this machine."""

    n: int

    def outcomes(self, units: Sequence[Unit], folder: Path) -> Iterator[tuple[Unit, bytes]]:
        """As each is ready; what is shared by the units of a drive is computed by the first."""
        with ProcessPoolExecutor(self.n, get_context("spawn"), _end_with_parent) as pool:
            try:
                yield from _in_two_rounds(units, lambda unit: pool.submit(work, unit, folder), as_completed)
            except BaseException:
                pool.shutdown(cancel_futures=True)
                raise


def _end_with_parent() -> None:
    """In a worker: end when the process that asked for it has ended, however it did."""
    parent = parent_process()

    def wait() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    Thread(target=wait, daemon=True).start()


@dataclass(frozen=True, slots=True)
class Cluster:
    """A Dask cluster, by the address of its scheduler: tcp://HOST:PORT."""

    scheduler: str

    def outcomes(self, units: Sequence[Unit], folder: Path) -> Iterator[tuple[Unit, bytes]]:
        """As each is ready.

        Raises:
            MisuseError: the extra is not installed.
            ModtError: nobody answers at the address.
        """
        try:
            from distributed import Client, as_completed
        except ImportError:
            cause, remedy = "needs the extra 'cluster'", "pip install 'modt[cluster]'"
            raise MisuseError("--scheduler", cause, remedy) from None
        try:
            client = Client(self.scheduler, timeout=10)
        except (OSError, ValueError) as error:
            raise ModtError(self.scheduler, f"no scheduler ({error})", "start it, or correct the address") from None
        with client:
            yield from _in_two_rounds(
                units, lambda unit: client.submit(work, unit, folder, pure=False, retries=2), as_completed
            )


def _in_two_rounds(
    units: Sequence[Unit], submit: Callable[[Unit], Any], completed: Callable[[list[Any]], Iterable[Any]]
) -> Iterator[tuple[Unit, bytes]]:
    """One unit of each basis, which the others then find in the store; then the others."""
    first: dict[str, Unit] = {}
    for unit in units:
        first.setdefault(unit.basis, unit)
    early = {unit.key for unit in first.values()}
    for chosen in ([*first.values()], [unit for unit in units if unit.key not in early]):
        of = {submit(unit): unit for unit in chosen}
        for future in completed(list(of)):
            yield of[future], future.result()
