"""Targets of fuzzing: readers, the bytes that they are fed with, and how they may refuse them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from modt.errors import ModtError

Feed = tuple[Sequence[bytes], Callable[[bytes], object]]
"""Valid inputs, and a call that reads one."""


@dataclass(frozen=True)
class Target:
    """A reader, and the errors by which it may refuse an input."""

    name: str
    prepare: Callable[[Path], Feed]
    """Seeds and call, which keeps its files in a folder; skips where an extra is missing."""
    refusals: tuple[type[Exception], ...]


TARGETS: dict[str, Target] = {}


def target(*refusals):
    """Make a target of a function that prepares it, named as the function."""

    def made(prepare):
        TARGETS[prepare.__name__] = Target(prepare.__name__, prepare, (ModtError, *refusals))
        return prepare

    return made


def targets_of_files(readers):
    """Make a target of each reader of one file: by its name, the name of the file, the reader and valid contents."""

    def prepared(folder, file, read, seeds):
        return of_file(folder / file, lambda: read(folder / file), *seeds)

    for name, (file, read, seeds) in readers.items():
        TARGETS[name] = Target(name, partial(prepared, file=file, read=read, seeds=seeds), (ModtError,))


def of_file(path, read, *seeds):
    """Inputs that are the content of a file."""

    def call(raw):
        path.write_bytes(raw)
        read()

    return [seed.encode() if isinstance(seed, str) else seed for seed in seeds], call
