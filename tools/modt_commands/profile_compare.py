"""`modt-profile compare`: the modes against each other on one stream."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from modt import host
from modt.cli import options
from modt.errors import MisuseError


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command and its options."""
    count = options.bounded(int, 1, 1000, "a count")
    p = commands.add_parser("compare", help="run all modes on the same stream, interleaved")
    options.add_stream_options(p)
    options.add(p, "fov", "meter", "json", "html")
    p.add_argument("--repeat", type=count, default=3, metavar="K", help="repetitions (default: %(default)s)")
    against = "measure how far this file of modt-profile predict was off"
    p.add_argument("--against", type=Path, metavar="PREDICTION", help=against)
    options.add_examples(
        p,
        "modt-profile compare DRIVE --frames 0:50         what tracking saves there",
        "modt-profile compare DRIVE --json > costs.json   for modt-profile predict",
    )
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Compare the modes and report."""
    pinned = host.pin_to_core(arguments.core)
    # NumPy is imported from here on, after the process is pinned.
    from modt.app import inputs
    from modt.app.chosen_profile import choose
    from modt.energy.meters.discovery import discover
    from modt.energy.meters.meter import Conditions, Kind
    from modt_profiling.comparison.compare_report import Basis, compare_tree
    from modt_profiling.comparison.compare_view import compare_document, compare_plots
    from modt_profiling.comparison.mode_runs import MODES, VARIED, Comparison, identity, observe
    from modt_profiling.comparison.prediction_report import against, observed_tree, read_prediction
    from modt_profiling.energy.named_meter import choose_meter
    from modt_profiling.reporting.document import save
    from modt_profiling.reporting.quantity import to_json

    request = inputs.Request.of(arguments)
    stream = inputs.stream(request)
    asked = {**identity(request, stream.info), "fov": request.fov, "asked": list(request.frames)}
    prediction = None if arguments.against is None else read_prediction(arguments.against, asked)
    loaded = choose(request.profile, next(iter(stream), None), stream.info).config
    board = loaded.energy
    info = stream.info
    meters = choose_meter(discover(board), arguments.meter).meters
    metered = meters[0].facts.kind is not Kind.ESTIMATED
    comparison = Comparison(request, loaded, pinned, meters if metered else ())
    repetitions = []
    for number in range(arguments.repeat):
        if sys.stderr.isatty():
            print(f"modt-profile: {number + 1} of {arguments.repeat}", file=sys.stderr)
        repetitions.append(comparison.repetition())
    frames = len(repetitions[0][VARIED].lines)
    if not frames:
        raise MisuseError(info.name, "no usable frame", "give a stream that modt replay can work on")
    basis = Basis(board, meters[0].facts, info.period_s)
    about: dict[str, Any] = {
        **identity(request, stream.info),
        "frames": frames,
        "fov": request.fov,
        "repeat": arguments.repeat,
        "turn": min(comparison.turn_frames, frames),
        "basis": "as run" if metered else f"at {1 / info.period_s:.0f} Hz",
        "board": board.board,
        "conditions": {**Conditions(pinned or 0).read(), "core": pinned},
        "host": host.description(),
    }
    tree = compare_tree(repetitions, MODES, VARIED, basis, about)
    tree["observed"] = observed_tree(observe(request, loaded, None))
    if prediction is not None:
        tree["against"] = against(prediction, tree["modes"], tree["savings"])
    document = compare_document(tree)
    if arguments.html is not None:
        save(arguments.html, document.page(compare_plots(tree)))
    print(json.dumps(to_json(tree), indent=2) if arguments.json else document.text())
    return 0
