"""`modt-profile calibrate`: fits what a board's work costs, and writes it to a profile."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING

from modt import host
from modt.cli.replay import core, frames
from modt.errors import ModtError
from modt.profile import DEFAULT

if TYPE_CHECKING:
    from modt.energy.window_fit_calibration import Calibration

NEVER_S = 1e9
"""Shortest window where windows are closed by hand."""


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("calibrate", help="fit what this board's work costs, and write a profile")
    p.add_argument("path", nargs="?", type=Path, metavar="PATH", help="stream (default: the embedded one)")
    p.add_argument("--frames", type=frames, default=(0, 40), metavar="A:B", help="worked on over and over (0:40)")
    p.add_argument("--board", default="this board", metavar="NAME", help="name to write down")
    p.add_argument("--out", type=Path, default=Path("board.yaml"), metavar="FILE", help="default: %(default)s")
    p.add_argument("--profile", default=DEFAULT, metavar="NAME|FILE", help="to start from (default: %(default)s)")
    p.add_argument("--meter", metavar="NAME", help="meter to read (default: the best)")
    p.add_argument("--core", type=core, default="last", metavar="N|none", help="pin to core N (default: the last)")
    p.add_argument("--windows", type=_at_least(12), default=60, metavar="N", help="of varied load (default: 60)")
    p.add_argument("--window-s", type=_seconds, default=2.0, metavar="S", help="length of each (default: 2)")
    p.add_argument("--burst-s", type=_seconds, default=10.0, metavar="S", help="of one stage alone (default: 10)")
    p.set_defaults(run=run)


def _at_least(least: int) -> type[int]:
    def count(text: str) -> int:
        if not text.isdigit() or int(text) < least:
            raise argparse.ArgumentTypeError(f"{text!r} is too few or no number; write {least} or more")
        return int(text)

    return count  # type: ignore[return-value]


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.01 <= value <= 600:
        raise argparse.ArgumentTypeError(f"{text!r} is no time; write seconds from 0.01 to 600")
    return value


def run(arguments: argparse.Namespace) -> int:
    """Calibrate, print and write."""
    pinned = host.confine(arguments.core)
    host.keep_freed_pages()
    # NumPy loads from here on, after the process is confined.
    from dataclasses import replace

    import numpy as np

    from modt import profile
    from modt.classification.pointnet import PointNet
    from modt.cli import assemble, metering
    from modt.energy.attribution import FitError
    from modt.energy.instrumentation import CountedClassifier
    from modt.energy.ledger import Ledger
    from modt.energy.window_fit_calibration import Work, calibrate
    from modt.geometry import FieldOfView
    from modt.segmentation.segmenter import Segmenter
    from modt.sinks.output import writing

    loaded = profile.load(arguments.profile)
    stream = assemble.stream(assemble.Request(path=arguments.path, frames=arguments.frames))
    scans = list(stream)
    if not scans:
        raise ModtError(stream.info.name, "no usable frame", "give a stream that modt replay can work on")
    chosen = metering.meters(loaded.energy).choose(arguments.meter)
    assert chosen.facts is not None
    ledger, limits = Ledger(), loaded.classification
    work = Work(
        frames=scans,
        segmenter=Segmenter(loaded.segmentation, loaded.sensor, FieldOfView()),
        classifier=CountedClassifier(PointNet(limits, loaded.sensor), ledger, limits.max_points, limits.batch),
        ledger=ledger,
        windows=metering.windows(loaded.energy, pinned, arguments.meter, NEVER_S),
        sleep=time.sleep,
        monotonic_ns=time.monotonic_ns,
    )
    try:
        found = calibrate(work, arguments.windows, arguments.window_s, arguments.burst_s, np.random.default_rng(0))
    except FitError as error:
        raise ModtError(chosen.facts.name, str(error), "use a better meter, or more and longer windows") from None
    value = {c.name: c.value for c in found.fit.coefficients}
    energy = replace(
        loaded.energy,
        board=arguments.board,
        meter=f"{chosen.facts.name} ({chosen.facts.kind.value})",
        idle_W=round(max(value["idle_W"], 0.0), 6),
        busy_W=round(found.busy_W, 6),
        seg_J=value["seg_J"],
        class_J=value["class_J"],
        point_J=value["point_J"],
    )
    with writing(arguments.out):
        arguments.out.write_text(profile.to_yaml(profile.dump(replace(loaded, energy=energy))), encoding="utf-8")
    print(text(found, chosen.facts.name, chosen.facts.kind.value, str(arguments.out)))
    return 0


def text(found: Calibration, meter: str, kind: str, out: str) -> str:
    """Coefficients with their intervals, the cross-check, and what it is worth."""
    fit = found.fit
    lines = [f"{meter}: {kind}; {fit.windows} windows fitted, {fit.dropped} dropped", ""]
    for c in fit.coefficients:
        lines.append(f"  {c.name:<10}{c.value:>14.6g}   95 %: {c.low:.6g} to {c.high:.6g}   (from {kind} windows)")
    lines += [
        "",
        f"  explained {100 * fit.explained:.1f} % of the variance, left {fit.residual_J:.3g} J a window, "
        f"condition {fit.condition:.0f}",
        f"  busy power {found.busy_W:.3f} W",
        _check("segmentation", found.fit["seg_J"].value, found.seg_burst_J),
        _check("classification", found.class_fit_J, found.class_burst_J),
    ]
    if kind == "estimated":
        lines.append("  the meter is a model: this gives the model back and says nothing of the board")
    return "\n".join([*lines, f"  written to {out}; use it as --profile {out}"])


def _check(stage: str, by_fit: float, by_burst: float | None) -> str:
    if by_burst is None:
        return f"  cross-check {stage}: unavailable, no burst had a reading"
    off = f"{100 * (by_fit / by_burst - 1):+.1f} %" if by_burst else "-"
    return f"  cross-check {stage}: {1e3 * by_burst:.4g} mJ in bursts, {1e3 * by_fit:.4g} mJ by the fit ({off})"
