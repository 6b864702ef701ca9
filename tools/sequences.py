"""Feed the pipeline with random sequences of frames, and hold it to what it promises.

    python -m tools.sequences --n 10000 --seed 1

Frames are empty, huge, repeated, late, or not finite, poses leap, clocks are set, sensors change in mid-run. The
first broken promise is printed with the shortest sequence that breaks it; then the exit status is 1.
"""

from __future__ import annotations

import logging
import sys
import time
import warnings

from tools.options import parser

BLOCK = 250
"""Sequences between two lines of progress."""


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--n", type=int, default=1000, help="sequences (default: %(default)s)")
    options.add_argument("--steps", type=int, default=25, help="of each at most (default: %(default)s)")
    options.add_argument("--seed", type=int, default=1)
    given = options.parse_args()
    from hypothesis import HealthCheck, Phase, seed, settings
    from hypothesis.stateful import run_state_machine_as_test

    from tests.sequences.machine import Sequences

    warnings.simplefilter("error")
    logging.disable()
    began_s = time.monotonic()
    for done in range(0, given.n, BLOCK):
        chosen = settings(
            max_examples=min(BLOCK, given.n - done),
            stateful_step_count=given.steps,
            deadline=None,
            database=None,
            phases=(Phase.generate, Phase.shrink),
            suppress_health_check=list(HealthCheck),
        )
        machine = seed(1_000_000 * given.seed + done)(type("Sequences", (Sequences,), {}))
        try:
            run_state_machine_as_test(machine, settings=chosen)
        except Exception as broken:
            print("\n".join(["broken:", *getattr(broken, "__notes__", []), f"{type(broken).__name__}: {broken}"]))
            sys.exit(1)
        print(f"{done + chosen.max_examples} sequences, {time.monotonic() - began_s:.0f} s", flush=True)
    print("every promise was kept")


if __name__ == "__main__":
    main()
