"""CPU time of a whole frame and of its segmentation, on both kernels, beside a published ground filter.

    python -m tools.bench.frame DRIVE [--frames N] [--write]

The pipelines on compiled kernels and on NumPy, Patchwork++ (ground only; extra "bench") and the yardstick, sorting
100,000 numbers, run in one thread on the full circle, in random order on each frame. Ratios are of medians, with 95 %
intervals from resampled frames. --write puts the table into docs/segmentation.md. A busy machine slows the yardstick
as well: to compare two runs, compare their ratios to it.
"""

from __future__ import annotations

import gc
import json
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from modt import host, profile
from modt.app import assembly
from modt.config import NATIVE
from modt.config import NUMPY as NUMPY_KERNELS
from modt.energy.ledger import Ledger
from modt.geometry import FieldOfView
from modt.pipeline import SEGMENTATION
from modt.sources.recognise import open_stream
from modt.types import Float64, Frame
from tools.bench.ground import Patchwork, cpu_ms
from tools.docs.sections import DOCS, update
from tools.options import parser

FIRST = 10
"""Frames left out while tracks begin."""
MODES = ("accurate", "efficient")
PART = "segmentation in it"
BASELINE = "Patchwork++: ground alone"
YARDSTICK = "sorting 100,000 numbers"
PAGE = DOCS / "segmentation.md"
_NUMBERS = np.random.default_rng(0).random(100_000)

Work = Callable[[Frame], float]
"""Work on a frame, which returns its CPU time [ms]."""
Rows = dict[str, dict[str, float]]


def segmentation_ms(ledger: Ledger, frame: Frame) -> float:
    """CPU time of the stage in the last frame [ms]."""
    return ledger.close_frame(frame.index).stages[SEGMENTATION].cpu_ns / 1e6


def contenders() -> dict[str, Work]:
    """Work to time, by name."""
    found: dict[str, Work] = {YARDSTICK: partial(cpu_ms, lambda _: np.sort(_NUMBERS))}
    if find_spec("pypatchworkpp"):
        patchwork = Patchwork()
        found[BASELINE] = partial(cpu_ms, lambda frame: patchwork.run(frame.points))
    shipped = profile.load("hdl-64e")
    for kernels in (NATIVE, NUMPY_KERNELS):
        config = replace(shipped, segmentation=replace(shipped.segmentation, kernels=kernels))
        for mode in MODES:
            ledger = Ledger()
            pipeline = assembly.pipeline(assembly.MODES[mode], config, FieldOfView(), ledger)
            budget = assembly.MODES[mode].budget(config)
            found[f"{mode}, {kernels}"] = partial(cpu_ms, partial(pipeline.step, budget=budget))
            found[f"{PART} ({mode}, {kernels})"] = partial(segmentation_ms, ledger)
    return found


def measure(frames: list[Frame], work: dict[str, Work]) -> dict[str, Float64]:
    """CPU times of all work on every frame but the first ones [ms].

    The order is random on each frame, because the first to run finds the points outside the cache. The parts of other
    work are read when all have run.
    """
    times: dict[str, list[float]] = {name: [] for name in work}
    whole, parts = ([name for name in work if name.startswith(PART) is part] for part in (False, True))
    rng = np.random.default_rng(0)
    gc.collect()
    gc.freeze()  # as every loop does before its first frame
    for frame in frames:
        for name in (*rng.permutation(whole).tolist(), *parts):
            times[name].append(work[name](frame))
    gc.unfreeze()
    return {name: np.array(ms[FIRST:]) for name, ms in times.items()}


def ratio(of: Float64, to: Float64) -> tuple[float, float, float]:
    """Ratio of medians, and its 95 % interval from resampled frames."""
    rows = np.random.default_rng(0).integers(0, len(of), (1000, len(of)))
    low, high = np.quantile(np.median(of[rows], axis=1) / np.median(to[rows], axis=1), [0.025, 0.975])
    return float(np.median(of) / np.median(to)), float(low), float(high)


def summary(times: dict[str, Float64]) -> Rows:
    """Median of each work [ms], and its ratios to the baseline and to the yardstick."""
    rows: Rows = {}
    for name, ms in times.items():
        rows[name] = {"median_ms": float(np.median(ms)), "to_yardstick": ratio(ms, times[YARDSTICK])[0]}
        if BASELINE in times:
            low_high = zip(("to_patchwork", "low", "high"), ratio(ms, times[BASELINE]), strict=True)
            rows[name] |= dict(low_high)
    return rows


def table(rows: Rows) -> str:
    """The rows as Markdown."""
    lines = ["| CPU time a frame | median | of Patchwork++'s |", "|---|---|---|"]
    for name, row in rows.items():
        share = f"{row['to_patchwork']:.2f} ({row['low']:.2f}, {row['high']:.2f})" if "low" in row else ""
        lines.append(f"| {name} | {row['median_ms']:.2f} ms | {share} |")
    return "\n".join(lines)


def main() -> None:
    options = parser(__doc__)
    options.add_argument("drive", type=Path)
    options.add_argument("--frames", type=int, default=60)
    options.add_argument("--write", action="store_true", help="put the table into docs/segmentation.md")
    arguments = options.parse_args()
    host.keep_freed_pages()
    frames = [frame for frame, _ in zip(open_stream(arguments.drive), range(arguments.frames), strict=False)]
    rows = summary(measure(frames, contenders()))
    print(json.dumps(rows, indent=2))
    if arguments.write:
        update(PAGE, "cost of a frame", table(rows))


if __name__ == "__main__":
    main()
