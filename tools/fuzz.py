"""Feed the readers of outside bytes with broken ones, each reader in a process of its own.

    python -m tools.fuzz [TARGET ...] --seconds 60 --seed 1

Where the extra [fuzz] is installed, atheris mutates the inputs, led by coverage; else the mutations are random. An
error that no reader may raise is written to --out with its input, and the exit status is 1. Inputs that cover more
code are kept there too, and a later run begins with them.
"""

from __future__ import annotations

import logging
import mmap
import multiprocessing
import os
import random
import struct
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from tools.options import parser

PATIENCE_S = 60.0
"""Time after which a process that exceeds its seconds is ended [s]."""
MEMORY = Path("/dev/shm")
"""File system in memory for the inputs, used where it exists."""
Feed = Callable[[bytes], None]


class InputLog:
    """Number of inputs that a process has read, and the last input, in memory that outlives it."""

    HEAD = struct.Struct("<QQ")
    MOST_BYTES = 1 << 24

    def __init__(self) -> None:
        self._memory = mmap.mmap(-1, self.HEAD.size + self.MOST_BYTES)

    def note(self, raw: bytes) -> None:
        """Note an input that is about to be read."""
        kept = raw[: self.MOST_BYTES]
        self.HEAD.pack_into(self._memory, 0, self.executions + 1, len(kept))
        self._memory[self.HEAD.size : self.HEAD.size + len(kept)] = kept

    @property
    def executions(self) -> int:
        """Number of inputs noted."""
        return int(self.HEAD.unpack_from(self._memory)[0])

    @property
    def last(self) -> bytes:
        """Last input noted."""
        return self._memory[self.HEAD.size :][: self.HEAD.unpack_from(self._memory)[1]]


@dataclass(frozen=True)
class Job:
    """Task of a process."""

    target: Any
    seconds: float
    seed: int
    out: Path
    folder: Path
    coverage: bool
    log: InputLog


def main() -> None:
    options = parser(__doc__)
    options.add_argument("targets", nargs="*", metavar="TARGET", help="default: all")
    options.add_argument("--seconds", type=float, default=10.0, help="for each target (default: %(default)s)")
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--out", type=Path, default=Path("runs/fuzz"), help="folder (default: %(default)s)")
    options.add_argument("--random", action="store_true", help="mutations at random even with atheris")
    arguments = options.parse_args()
    coverage = find_spec("atheris") is not None and not arguments.random
    with _instrumented(coverage):  # once: the processes are forks of this one
        from tests.fuzz.targets import TARGETS
    unknown = set(arguments.targets) - set(TARGETS)
    if unknown:
        options.error(f"no target {', '.join(sorted(unknown))}; there are {', '.join(TARGETS)}")
    print("led by coverage (atheris)" if coverage else "at random")
    found = 0
    for name in arguments.targets or TARGETS:
        out = arguments.out / name
        out.mkdir(parents=True, exist_ok=True)
        for old in (*out.glob("*.txt"), *out.glob("*.input")):
            old.unlink()
        with tempfile.TemporaryDirectory(dir=MEMORY if MEMORY.is_dir() else None) as folder:
            job = Job(TARGETS[name], arguments.seconds, arguments.seed, out, Path(folder), coverage, InputLog())
            found += _supervise(job)
    sys.exit(1 if found else 0)


def _instrumented(coverage: bool) -> AbstractContextManager[object]:
    """Context in which imported modules of the package report their coverage."""
    if not coverage:
        return nullcontext()
    import atheris

    return atheris.instrument_imports(include=["modt"])


def _supervise(job: Job) -> int:
    """Run a job, print its summary, and return the number of its findings."""
    began = time.monotonic()
    process = multiprocessing.get_context("fork").Process(target=_fuzz, args=(job,))
    process.start()
    process.join(job.seconds + PATIENCE_S)
    ended = process.exitcode
    if ended is None:
        process.kill()
        process.join()
    seconds = time.monotonic() - began
    findings = sorted(job.out.glob("*.txt"))
    done = f"{job.log.executions} executions in {seconds:.0f} s"
    print(f"{job.target.name}: {done}, {len(findings)} findings", flush=True)
    for text in findings:
        print("  " + text.read_text().partition("\n")[0])
    if ended != 0:
        last = job.out / "last.input"
        last.write_bytes(job.log.last)
        print(f"  the process {'did not answer' if ended is None else f'ended by {ended}'}; its last input is {last}")
    return len(findings) + (ended != 0)


def _fuzz(job: Job) -> None:
    """The process of a target."""
    import pytest

    from tests.fuzz.execution import execute, limits
    from tests.fuzz.mutation import mutations

    logging.basicConfig(handlers=[logging.NullHandler()])
    places = set[str]()
    with _instrumented(job.coverage):
        try:
            seeds, call = job.target.prepare(job.folder)
        except pytest.skip.Exception as skipped:
            print(f"{job.target.name}: {skipped}")
            return
        with limits():
            ends = time.monotonic() + job.seconds

            def feed(raw: bytes) -> None:
                if time.monotonic() > ends:
                    os._exit(0)  # exit handlers of libraries may wait for threads that a fork does not have
                job.log.note(raw)
                found = execute(call, raw, job.target.refusals)
                if found is not None and found.place not in places:
                    places.add(found.place)
                    name = found.place.replace(":", "-")
                    (job.out / f"{name}.input").write_bytes(raw)
                    (job.out / f"{name}.txt").write_text(f"{found.error} ({found.place})\n\n{found.trace}")

            if job.coverage:
                _by_coverage(job, seeds, feed)
            else:
                for raw in mutations(seeds, sys.maxsize, job.seed):
                    feed(raw)


def _by_coverage(job: Job, seeds: Any, feed: Feed) -> None:
    """Feed mutations, half of them by atheris, half by the project, which also change words of a text."""
    import atheris

    from tests.fuzz.mutation import mutated

    def mutate(raw: bytes, most: int, seed: int) -> bytes:
        chance = random.Random(seed)
        return atheris.Mutate(raw, most) if chance.random() < 0.5 else mutated(raw, seeds, chance)[:most]

    corpus = job.out / "corpus"
    corpus.mkdir(exist_ok=True)
    for number, seed in enumerate(seeds):
        (corpus / f"seed-{number}").write_bytes(seed)
    limits = ["-rss_limit_mb=0", "-timeout=3600", f"-max_len={max(map(len, seeds)) + 4096}"]
    quiet = ["-verbosity=0", f"-artifact_prefix={job.out}/"]
    atheris.Setup(["fuzz", str(corpus), *limits, *quiet, f"-seed={job.seed}"], feed, custom_mutator=mutate)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
