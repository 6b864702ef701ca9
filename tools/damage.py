"""Damage small recordings at random places, and compare what is read with what other readers still give.

    python -m tools.damage --recordings 300 --seed 1 [--form FORM ...]

Bytes are changed, erased, inserted or removed, files are cut off or lost. Other readers are the library `mcap` (by
the index, and past bad chunks as in `mcap recover`), SQLite with its `.recover`, and a reader of PCAP that stops at
the first damage. A sweep that others give must be read, a loss must be reported, counts must agree, and each
recording has --limit seconds. Prints the sweeps given and read by form, and each broken promise; then the exit status
is 1.
"""

from __future__ import annotations

import logging
import random
import signal
import sys
import tempfile
from collections import Counter
from pathlib import Path

from tools.options import parser


def _expire(*_: object) -> None:
    raise TimeoutError


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--recordings", type=int, default=300, help="in all (default: %(default)s)")
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--form", action="append", help="form of the recordings (default: all of them)")
    options.add_argument("--limit", type=int, default=60, help="for a recording [s] (default: %(default)s)")
    given = options.parse_args()
    from tests.fuzz.damage import WRITERS, trial

    logging.disable(logging.CRITICAL)
    signal.signal(signal.SIGALRM, _expire)
    forms = given.form or [*WRITERS]
    broken = 0
    trials = Counter[str]()
    sums = {form: Counter[str]() for form in forms}
    rng = random.Random(given.seed)
    for n in range(given.recordings):
        form = forms[n % len(forms)]
        seed = rng.randrange(2**31)
        trials[form] += 1
        with tempfile.TemporaryDirectory(prefix="modt-damage-") as folder:
            signal.alarm(given.limit)
            try:
                made = trial(Path(folder), form, seed)
            except TimeoutError:
                broken += 1
                print(f"{form}, {seed}: not read within {given.limit} s", flush=True)
                continue
            finally:
                signal.alarm(0)
        sums[form].update(read=made.read, given=made.given)
        if made.broken:
            broken += 1
            print(f"{form}, {seed}: {made.broken}", flush=True)
    for form, counts in sums.items():
        print(f"{form:28} {trials[form]:4} recordings, {counts['given']:5} sweeps given, {counts['read']:5} read")
    print(f"{broken} of {given.recordings} break a promise" if broken else "every promise was kept")
    sys.exit(bool(broken))


if __name__ == "__main__":
    main()
