"""Targets of fuzzing: readers, the bytes that they are fed with, and how they may refuse them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from modt.errors import ModtError

Feed = tuple[Sequence[bytes], Callable[[bytes], object]]
"""Valid inputs, and a call that reads one."""


@dataclass(frozen=True, slots=True)
class Target:
    """A reader, and the errors by which it may refuse an input."""

    name: str
    prepare: Callable[[Path], Feed]
    """Seeds and call, which keeps its files in a folder; skips where an extra is missing."""
    refusals: tuple[type[Exception], ...]


TARGETS: dict[str, Target] = {}


def target(*refusals: type[Exception]) -> Callable[[Callable[[Path], Feed]], Callable[[Path], Feed]]:
    """Make a target of a function that prepares it, named as the function."""

    def made(prepare: Callable[[Path], Feed]) -> Callable[[Path], Feed]:
        TARGETS[prepare.__name__] = Target(prepare.__name__, prepare, (ModtError, *refusals))
        return prepare

    return made


def of_file(path: Path, read: Callable[[], object], *seeds: bytes | str) -> Feed:
    """Inputs that are the content of a file."""

    def call(raw: bytes) -> None:
        path.write_bytes(raw)
        read()

    return [seed.encode() if isinstance(seed, str) else seed for seed in seeds], call
