"""Estimated CPU time of a frame on boards that were not measured.

    python -m tools.study.boards [--rating MIPS] [--sensors NAME ...] [--seeds 600:602] [--seconds 4] [--write]

The work of a frame is counted and timed on this machine, on the full circle of simulated streets. Its time is scaled
by the single-threaded rating of the 7-Zip benchmark, which is measured here (`7z b -mmt=1`, package p7zip-full) and
published for the boards. The benchmark is integers, branches and cache misses, as most of a frame is, but not the
network. Expect half to twice as much, and measure on the board with `modt-profile calibrate DRIVE`. --write puts the
table into docs/deployment.md.
"""

from __future__ import annotations

import gc
import re
import subprocess
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from modt import host, profile
from modt.cli.options import frames as number_range
from modt_simulation.sensors import SENSORS
from modt_simulation.synthetic_stream import SyntheticStream
from tools.docs.sections import DOCS, update
from tools.options import parser
from tools.study.drives import steps_of

BOARDS = {
    "Raspberry Pi 4 (Cortex-A72, 1.8 GHz)": 1752,
    "Jetson Orin Nano (Cortex-A78AE, 1.5 GHz)": 2153,
    "Raspberry Pi 5 (Cortex-A76, 2.4 GHz)": 3196,
    "mini PC (Intel N100, 3.4 GHz)": 3910,
}
"""Rating in MIPS, as github.com/ThomasKaiser/sbc-bench publishes it (Sorted-Results.md, 64-bit systems); the lowest
where there are several."""
MODES = ("accurate", "efficient")
PAGE = DOCS / "deployment.md"
_FIRST = 10
"""Frames left out while tracks begin."""


@dataclass(frozen=True)
class Work:
    """Mean work of a frame of a sensor in a mode, and its median CPU time on this machine."""

    sensor: str
    mode: str
    points: float
    proposals: float
    calls: float
    cpu_ms: float


def rating_of(output: str) -> int:
    """Rating of one fully used thread in the output of `7z b -mmt=1` [MIPS].

    Raises:
        ValueError: the output has no rating.
    """
    total = re.search(r"^Tot:\s+\d+\s+(\d+)\s+\d+\s*$", output, re.MULTILINE)
    if total is None:
        raise ValueError("no line Tot: with usage, rating by usage, and rating")
    return int(total[1])


def measured_rating() -> int:
    """Rating of this machine [MIPS]."""
    try:
        done = subprocess.run(["7z", "b", "-mmt=1"], capture_output=True, text=True, check=True)
        return rating_of(done.stdout)
    except (OSError, subprocess.CalledProcessError, ValueError) as error:
        raise SystemExit(f"boards: 7z b -mmt=1: {error}; install p7zip-full, or give --rating") from None


def work_of(sensor: str, mode_name: str, seeds: Sequence[int], seconds: float) -> Work:
    """Count and time the frames of simulated streets."""
    rows: list[tuple[float, float, float, float]] = []
    config = profile.load(sensor)
    for seed in seeds:
        frames = list(SyntheticStream("street", sensor, seconds, seed))
        step = steps_of(mode_name, config)
        gc.collect()
        for number, frame in enumerate(frames):
            start = time.thread_time_ns()
            result = step(frame)
            cpu_ms = (time.thread_time_ns() - start) / 1e6
            if number >= _FIRST:
                rows.append((len(frame.points), len(result.proposals), len(result.classified), cpu_ms))
    points, proposals, calls, cpu_ms = np.array(rows).T
    return Work(sensor, mode_name, points.mean(), proposals.mean(), calls.mean(), float(np.median(cpu_ms)))


def table(works: Sequence[Work], rating: int) -> str:
    """The work, its CPU time here, and the expected CPU time on each board [ms], as Markdown."""
    lines = [
        f"| sensor, mode | points | proposals | calls | measured ({rating} MIPS) | {' | '.join(BOARDS)} |",
        "|" + "---|" * (5 + len(BOARDS)),
    ]
    for work in works:
        counts = f"{work.points:,.0f} | {work.proposals:.0f} | {work.calls:.1f} | {work.cpu_ms:.1f} ms"
        expected = (f"{work.cpu_ms * rating / board:.0f} ms" for board in BOARDS.values())
        lines.append(f"| {work.sensor}, {work.mode} | {counts} | {' | '.join(expected)} |")
    return "\n".join(lines)


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--rating", type=int, help="rating of this machine [MIPS] (default: measured)")
    options.add_argument("--sensors", nargs="+", choices=SENSORS, default=["hdl-64e", "os1-64", "vlp-16", "mid-360"])
    options.add_argument("--seeds", type=number_range, default=(600, 602), metavar="A:B")
    options.add_argument("--seconds", type=float, default=4.0)
    options.add_argument("--write", action="store_true", help="put the table into docs/deployment.md")
    given = options.parse_args()
    host.keep_freed_pages()
    rating = measured_rating() if given.rating is None else given.rating
    seeds = range(*given.seeds)
    text = table([work_of(sensor, mode, seeds, given.seconds) for sensor in given.sensors for mode in MODES], rating)
    print(text)
    if given.write:
        update(PAGE, "boards", text)


if __name__ == "__main__":
    main()
