"""Fail the calls of the system that a short run of a service makes, one by one and then two at a time.

    python -m tools.faults --runs 2000 --seed 1

A run without faults lists every call that touches the disk, a socket, a clock or the meter. In half of the runs one
of them fails, evenly over their kinds, in the others two do; in three runs of ten the calls of a kind fail for two
seconds. The run must go on, what is recorded must be whole, every missing line must be counted, and the status
must be readable throughout. Prints each broken promise with the calls that break it; then the exit status is 1.
"""

from __future__ import annotations

import logging
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tools.options import parser

if TYPE_CHECKING:
    from tests.crash.faulty_run import FaultyRun

LASTING_S = 2.0
MOST_PRINTED = 40


@dataclass(frozen=True)
class Plan:
    """Calls of a run that fail, by their numbers, each with the way in which it does, and for how long [s]."""

    ways: dict[int, int]
    lasting_s: float = 0.0


def plan(n: int, runs: int, calls: list[str], rng: np.random.Generator) -> Plan:
    """The plan of a run: half of the runs fail one call, evenly over the kinds of calls, the other half two."""
    if not n:
        return Plan({})
    single = n <= runs // 2
    ways = int(rng.integers(1000))
    kinds = sorted({*calls})
    chosen = [kinds[n % len(kinds)]] if single else rng.choice(kinds, 2)
    at = [int(rng.choice([k for k, name in enumerate(calls) if name == one])) for one in chosen]
    return Plan({k: ways + i for i, k in enumerate(at)}, LASTING_S * (rng.random() < 0.3))


def outcome(run: FaultyRun) -> str:
    """The promise that a run breaks, empty if it keeps all."""
    try:
        run.run()
        run.check()
    except Exception as error:
        return f"{type(error).__name__}: {str(error).splitlines()[0][:150] if str(error) else ''}"
    return ""


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--runs", type=int, default=2000, help="in all (default: %(default)s)")
    options.add_argument("--seed", type=int, default=1)
    given = options.parse_args()
    from tests.crash.faulty_run import FaultyRun

    logging.disable(logging.CRITICAL)
    rng = np.random.default_rng(given.seed)
    began_s = time.perf_counter()
    broken = Counter[str]()
    calls = list[str]()
    for n in range(given.runs + 1):
        planned = plan(n, given.runs, calls, rng)
        with tempfile.TemporaryDirectory(prefix="modt-faults-") as folder:
            run = FaultyRun(Path(folder), planned.ways, planned.lasting_s)
            what = outcome(run)
        if what:
            broken[what] += 1
            if broken.total() <= MOST_PRINTED:
                names = ", ".join(f"{calls[k] if calls else ''} ({k}, {way})" for k, way in planned.ways.items())
                print(f"broken by {names} for {planned.lasting_s:g} s: {what}", flush=True)
        calls = calls or run.faults.calls
        if n % 100 == 0:
            spent_s = time.perf_counter() - began_s
            print(f"{n} runs of {len(calls)} calls, {spent_s:.0f} s, {broken.total()} broken", flush=True)
    print("\n".join(f"{number} times {what}" for what, number in broken.most_common()) or "every promise was kept")
    sys.exit(bool(broken))


if __name__ == "__main__":
    main()
