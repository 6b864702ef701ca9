"""Feed the readers of outside bytes with broken ones, each reader in a process of its own.

    python -m tools.fuzz [TARGET ...] --seconds 60 --seed 1

By atheris, which is led by coverage, where the extra [fuzz] is installed; else by random mutations. What should not
have left a reader is written to --out with its input; then the exit status is 1.
"""

from __future__ import annotations

import multiprocessing
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from tools.options import parser

PATIENCE_S = 60.0
"""After its seconds, until a process that does not answer is ended."""
LAST = "last-input"
Feed = Callable[[bytes], None]


@dataclass(frozen=True)
class Job:
    """What a process is to do."""

    target: str
    seconds: float
    seed: int
    out: Path
    coverage: bool


def main() -> None:
    options = parser(__doc__)
    options.add_argument("targets", nargs="*", metavar="TARGET", help="default: all")
    options.add_argument("--seconds", type=float, default=10.0, help="for each target (default: %(default)s)")
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--out", type=Path, default=Path("runs/fuzz"), help="folder (default: %(default)s)")
    options.add_argument("--random", action="store_true", help="mutations at random even with atheris")
    arguments = options.parse_args()
    from tests.fuzz.targets import TARGETS

    unknown = set(arguments.targets) - set(TARGETS)
    if unknown:
        options.error(f"no target {', '.join(sorted(unknown))}; there are {', '.join(TARGETS)}")
    coverage = find_spec("atheris") is not None and not arguments.random
    print("led by coverage (atheris)" if coverage else "at random")
    found = 0
    for name in arguments.targets or TARGETS:
        out = arguments.out / name
        shutil.rmtree(out, ignore_errors=True)
        out.mkdir(parents=True)
        found += _supervise(Job(name, arguments.seconds, arguments.seed, out, coverage))
    sys.exit(1 if found else 0)


def _supervise(job: Job) -> int:
    """Run a job, tell of it, and return the number of its findings."""
    context = multiprocessing.get_context("spawn")
    executions = context.Value("Q", 0)
    began = time.monotonic()
    process = context.Process(target=_run, args=(job, executions))
    process.start()
    process.join(job.seconds + PATIENCE_S)
    ended = process.exitcode
    if ended is None:
        process.kill()
        process.join()
    seconds = time.monotonic() - began
    findings = sorted(job.out.glob("*.txt"))
    print(f"{job.target}: {executions.value} executions in {seconds:.0f} s, {len(findings)} findings", flush=True)
    for text in findings:
        print("  " + text.read_text().partition("\n")[0])
    if ended != 0:
        how = "did not answer" if ended is None else f"ended by {ended}"
        print(f"  the process {how}; its last input is {job.out / LAST}")
    return len(findings) + (ended != 0)


def _run(job: Job, executions: Any) -> None:
    """The process of a target."""
    if job.coverage:
        import atheris

        with atheris.instrument_imports(include=["modt"]):
            _fuzz(job, executions)
    else:
        _fuzz(job, executions)


def _fuzz(job: Job, executions: Any) -> None:
    import pytest

    from tests.fuzz.execution import execute, limits
    from tests.fuzz.mutation import mutations
    from tests.fuzz.targets import TARGETS

    target, places, last = TARGETS[job.target], set[str](), job.out / LAST
    with tempfile.TemporaryDirectory() as folder:
        try:
            seeds, call = target.prepare(Path(folder))
        except pytest.skip.Exception as skipped:
            print(f"{job.target}: {skipped}")
            return
        with limits():

            def feed(raw: bytes) -> None:
                executions.value += 1
                last.write_bytes(raw)
                found = execute(call, raw, target.refusals)
                if found is not None and found.place not in places:
                    places.add(found.place)
                    name = found.place.replace(":", "-")
                    (job.out / f"{name}.input").write_bytes(raw)
                    (job.out / f"{name}.txt").write_text(f"{found.error} ({found.place})\n\n{found.trace}")

            if job.coverage:
                _by_coverage(job, seeds, feed)
            else:
                ends = time.monotonic() + job.seconds
                for raw in mutations(seeds, sys.maxsize, job.seed):
                    if time.monotonic() > ends:
                        break
                    feed(raw)
    last.unlink(missing_ok=True)


def _by_coverage(job: Job, seeds: Any, feed: Feed) -> None:
    """Ends the process."""
    import atheris

    corpus = job.out / "corpus"
    corpus.mkdir(exist_ok=True)
    for number, seed in enumerate(seeds):
        (corpus / f"seed-{number}").write_bytes(seed)
    limits = [f"-max_total_time={job.seconds:.0f}", f"-seed={job.seed}", "-rss_limit_mb=0", "-timeout=3600"]
    atheris.Setup(["fuzz", str(corpus), *limits, f"-max_len={max(map(len, seeds)) + 4096}", "-verbosity=0"], feed)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
