"""Feed the pipeline with random sequences of frames, and check its promises after each.

    python -m tools.sequences --n 10000 --seed 1
    python -m tools.sequences --live hesai livox --seconds 1800
    python -m tools.sequences --sweeps 100000

Frames are empty, huge, repeated, late or not finite; poses leap, clocks are set, sensors change in mid-run. With
--live the input is packets of a maker or clouds, and poses, thousands in a sequence. They are lost, forged or late on
their way to the loop of a robot, whose process is stopped at times. The first broken promise is printed with the
shortest sequence that breaks it; then the exit status is 1.

With --sweeps the frames are small sweeps of any shape: fog, rooms, one beam, equal points, tilted, thinned, huge or
not finite. Every twentieth is segmented by both kernels.
"""

from __future__ import annotations

import argparse
import logging
import math
import sys
import time
import warnings
from typing import Any

from tools.options import parser

BLOCK = 250
LIVE_BLOCK = 20
"""Sequences between two lines of progress."""


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--n", type=int, default=1000, help="sequences (default: %(default)s)")
    options.add_argument("--steps", type=int, default=25, help="longest sequence (default: %(default)s)")
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--seconds", type=float, default=math.inf, help="CPU time after which no block begins")
    options.add_argument("--live", nargs="*", metavar="SOURCE", help="live inputs instead of frames; default: all")
    options.add_argument("--sweeps", type=int, metavar="N", help="sweeps of any shape instead of sequences")
    given = options.parse_args()
    if given.sweeps:
        _feed_sweeps(given.sweeps, given.seed)
        return
    machine: type[Any]
    if given.live is not None:
        from tests.sequences.live_machine import SOURCES, LiveSequences

        if unknown := set(given.live) - set(SOURCES):
            options.error(f"no source {', '.join(sorted(unknown))}; there are {', '.join(SOURCES)}")
        SOURCES[:] = given.live or SOURCES
        machine = LiveSequences
    else:
        from tests.sequences.machine import Sequences

        machine = Sequences

    warnings.simplefilter("error")
    logging.lastResort = None
    logging.disable(logging.CRITICAL if given.live is None else logging.NOTSET)
    _feed(machine, given, BLOCK if given.live is None else LIVE_BLOCK)


def _feed(machine: type[Any], given: argparse.Namespace, block: int) -> None:
    """Run the sequences of a state machine, block by block."""
    from hypothesis import HealthCheck, Phase, seed, settings
    from hypothesis.stateful import run_state_machine_as_test

    began_s = time.monotonic()
    for done in range(0, given.n, block):
        if time.process_time() > given.seconds:
            break
        chosen = settings(
            max_examples=min(block, given.n - done),
            stateful_step_count=given.steps,
            deadline=None,
            database=None,
            phases=(Phase.generate, Phase.shrink),
            suppress_health_check=list(HealthCheck),
        )
        seeded = seed(1_000_000 * given.seed + done)(type("Sequences", (machine,), {}))
        try:
            run_state_machine_as_test(seeded, settings=chosen)
        except Exception as broken:
            print("\n".join(["broken:", *getattr(broken, "__notes__", []), f"{type(broken).__name__}: {broken}"]))
            sys.exit(1)
        print(f"{done + chosen.max_examples} sequences, {time.monotonic() - began_s:.0f} s", flush=True)
    print("every promise was kept")


def _feed_sweeps(n: int, seed: int) -> None:
    """Feed random sweeps, RUN_SWEEPS to a pipeline.

    Raises:
        AssertionError: a promise was broken.
    """
    from tests.sequences.sweeps import RUN_SWEEPS, feed

    logging.disable(logging.CRITICAL)
    for done in range(0, n, RUN_SWEEPS):
        feed(1_000_000 * seed + done, min(RUN_SWEEPS, n - done))
        print(f"{min(done + RUN_SWEEPS, n)} sweeps, {time.process_time():.0f} s", end="\r", flush=True)
    print("\nevery promise was kept")


if __name__ == "__main__":
    main()
