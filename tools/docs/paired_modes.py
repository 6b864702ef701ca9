"""Write the section of docs/paper.md on what tracking adds, on the same simulated drives for every mode.

    python -m tools.docs.paired_modes [--jobs N]

It takes ten minutes of CPU time.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from modt.classes import CLASS_NAMES
from modt.types import Float64
from modt_evaluation.class_score import class_scores
from modt_evaluation.engine import Engine
from modt_evaluation.evaluation import DriveRows
from modt_evaluation.experiments.markdown import commit
from tools.docs.sections import DOCS, update
from tools.options import parser
from tools.study import drives

PAGE = DOCS / "paper.md"
MARK = "tools.docs.paired_modes"
SENSORS = "vlp-16", "os1-64", "hdl-64e", "mid-360", "pandar64", "xt-32"

BASELINE = "conventional"
MODES = ("accurate", "efficient")
SCENES = ("street", "crossing")
SEEDS = range(1100, 1104)
"""Seeds of the drives of each sensor.

The first was looked at when `person_growth` of `modt.tracking.tuning` was added.
"""
SECONDS = 6.0
"""Duration of each drive [s]."""
RESAMPLES = 200
"""Draws of the drives of each sensor, with replacement, from which an interval is taken."""
Rows = Mapping[str, Sequence[DriveRows]]
"""Judged drives of each mode, in one order."""


def table(engine: Engine) -> Iterator[str]:
    """The mean over sensors with its 95 % interval, and each sensor, as Markdown."""
    judged = {sensor: _judged(engine, sensor) for sensor in SENSORS}
    yield f"Commit {commit()}; made by `python -m {MARK}`."
    yield ""
    number = len(SEEDS) * len(SCENES)
    title = f"AP less that of `{BASELINE}`, {number} simulated drives a sensor, paired [points]"
    yield f"| {title} | {' | '.join(CLASS_NAMES[1:])} |"
    yield "|---|" + "---|" * len(CLASS_NAMES[1:])
    for mode in MODES:
        mean, low, high = interval(list(judged.values()), mode, np.random.default_rng(0))
        cells = [f"{m:+.1f} ({a:+.1f}, {b:+.1f})" for m, a, b in zip(mean, low, high, strict=True)]
        yield f"| **`{mode}`, mean and 95 % interval** | {' | '.join(cells)} |"
        for sensor, rows in judged.items():
            yield f"| `{mode}`, {sensor} | {' | '.join(f'{d:+.1f}' for d in difference(rows, mode))} |"


def interval(judged: Sequence[Rows], mode: str, rng: np.random.Generator) -> tuple[Float64, Float64, Float64]:
    """(C,) mean over sensors of the difference [points] by class, and the ends of its 95 % interval."""
    mean: Float64 = np.mean([difference(rows, mode) for rows in judged], axis=0)
    drawn = [np.mean([difference(_drawn(rows, rng), mode) for rows in judged], axis=0) for _ in range(RESAMPLES)]
    low, high = np.quantile(drawn, [0.025, 0.975], axis=0)
    return mean, low, high


def difference(rows: Rows, mode: str) -> Float64:
    """(C,) average precision of a mode less that of BASELINE, by class [points]."""
    difference: Float64 = _precisions(rows[mode]) - _precisions(rows[BASELINE])
    return difference


def _drawn(rows: Rows, rng: np.random.Generator) -> Rows:
    """Draw as many drives with replacement, the same ones for every mode."""
    n = len(rows[BASELINE])
    index = rng.integers(n, size=n).tolist()
    return {mode: [drives[k] for k in index] for mode, drives in rows.items()}


def _precisions(rows: Sequence[DriveRows]) -> Float64:
    tables = (np.concatenate([getattr(drive, name) for drive in rows]) for name in ("objects", "proposals"))
    scores = class_scores(*tables)
    return np.array([100.0 * (scores[name].average_precision or 0.0) for name in CLASS_NAMES[1:]])


def _judged(engine: Engine, sensor: str) -> Rows:
    """Judged drives of a sensor in every mode."""
    modes = (BASELINE, *MODES)
    judged = drives.judged_in_order(engine, SCENES, sensor, SECONDS, SEEDS, modes, {})
    return {mode: [rows[k] for rows in judged] for k, mode in enumerate(modes)}


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--jobs", type=int, default=1, metavar="N", help="number of processes (default: 1)")
    with Engine(options.parse_args().jobs) as engine:
        made = "\n".join(table(engine))
    update(PAGE, MARK, made)


if __name__ == "__main__":
    main()
