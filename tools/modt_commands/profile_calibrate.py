"""`modt-profile calibrate`: fit the energy of a board's units of work, and write them to a profile."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from modt import host
from modt.cli import options
from modt.errors import ModtError

if TYPE_CHECKING:
    from modt_profiling.comparison.window_fit_calibration import Calibration


def add_parser(commands: options.Commands) -> None:
    """Declare the command and its options."""
    seconds = options.bounded(float, 0.01, 600, "seconds")
    p = commands.add_parser("calibrate", help="fit the energy of this board's units of work, and write its profile")
    options.add_stream_options(p, (0, 40))
    options.add(p, "meter")
    p.add_argument("--board", default="this board", metavar="NAME", help="name of the board in the profile")
    p.add_argument(
        "--out", type=Path, default=Path("board.yaml"), metavar="FILE", help="profile (default: %(default)s)"
    )
    count = options.bounded(int, 12, 100_000, "a count")
    varied = "number of windows of varied load (default: %(default)s)"
    p.add_argument("--windows", type=count, default=60, metavar="N", help=varied)
    p.add_argument(
        "--window-s", type=seconds, default=2.0, metavar="S", help="their length [s] (default: %(default)g)"
    )
    p.add_argument(
        "--burst-s", type=seconds, default=10.0, metavar="S", help="length of a burst [s] (default: %(default)g)"
    )
    options.add_examples(
        p,
        "modt-profile calibrate --board 'my board' --out board.yaml   some minutes on an idle machine",
        "modt-profile calibrate DRIVE --meter VDD_IN                  by another meter and stream",
    )
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Calibrate."""
    core = host.pin_to_core(arguments.core)
    host.keep_freed_pages()
    # NumPy is imported from here on, after the process is pinned.
    from dataclasses import replace

    import numpy as np

    from modt import profile
    from modt.app.inputs import Request
    from modt.sinks.output import writing
    from modt_profiling.comparison.window_fit_calibration import open_workload
    from modt_profiling.energy.board_fit import FitError

    workload, config = open_workload(Request.of(arguments), arguments.meter, core)
    meter = workload.meter
    try:
        found = workload.calibrate(arguments.windows, arguments.window_s, arguments.burst_s, np.random.default_rng(0))
    except FitError as error:
        raise ModtError(meter.name, str(error), "use a better meter, or more and longer windows") from None
    energy = replace(config.energy, board=arguments.board, meter=f"{meter.name} ({meter.kind})", **found.board)
    with writing(arguments.out):
        board = profile.dump(replace(config, energy=energy))["energy"]
        arguments.out.write_text(profile.to_yaml({"energy": board}), encoding="utf-8")
    print(text(found, meter.name, meter.kind, arguments.out))
    return 0


def text(found: Calibration, meter: str, kind: str, out: Path) -> str:
    """Coefficients with their intervals, the cross-check, and the kind of the meter."""
    fit = found.fit
    lines = [f"{meter}: {kind}; {fit.windows} windows fitted, {fit.dropped} dropped", ""]
    lines += [
        f"  {c.name:<10}{c.value:>14.6g}   95 %: {c.low:.6g} to {c.high:.6g}   (from {kind} windows)"
        for c in fit.coefficients
    ]
    lines += [
        "",
        f"  explained {100 * fit.explained:.1f} % of the variance, residual {fit.residual_J:.3g} J a window, "
        f"condition {fit.condition:.0f}",
        f"  busy power {found.busy_W:.3f} W",
        _check("segmentation", found.fit["seg_J"].value, found.seg_burst_J),
        _check("classification", found.class_fit_J, found.class_burst_J),
    ]
    if kind == "estimated":
        lines.append("  the meter is a model: the fit reproduces the model and says nothing of the board")
    return "\n".join([*lines, f"  written to {out}; add it to the sensor's: --profile {out}"])


def _check(stage: str, by_fit: float, by_burst: float | None) -> str:
    if by_burst is None:
        return f"  cross-check {stage}: unavailable, no burst had a reading"
    deviation = f"{100 * (by_fit / by_burst - 1):+.1f} %" if by_burst else "-"
    return f"  cross-check {stage}: {1e3 * by_burst:.4g} mJ in bursts, {1e3 * by_fit:.4g} mJ by the fit ({deviation})"
