"""`modt-profile predict`: what the modes will cost on a stream, before any of them runs on it."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from modt import host
from modt.cli import options
from modt.errors import MisuseError


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("predict", help="predict energy and gamma of the modes from other streams")
    options.add_stream_options(p)
    options.add(p, "fov", "json")
    calibration = "JSON of modt-profile compare of another stream; repeatable"
    p.add_argument("--calibration", type=Path, action="append", required=True, metavar="FILE", help=calibration)
    seen = "part of the frames to track without classifying (default: %(default)s)"
    p.add_argument("--observe", choices=("third", "all"), default="third", help=seen)
    p.add_argument("--out", type=Path, metavar="PREDICTION", help="write the JSON for modt-profile compare --against")
    options.add_examples(
        p,
        "modt-profile predict DRIVE --calibration costs.json                    before any mode has run there",
        "modt-profile predict DRIVE --calibration costs.json --out blind.json   for compare --against",
    )
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Predict."""
    pinned = host.pin_to_core(arguments.core)
    # NumPy is imported from here on, after the process is pinned.
    import numpy as np

    from modt.app import inputs
    from modt.app.chosen_profile import choose
    from modt.sinks.output import writing
    from modt_profiling.comparison.mode_runs import identity, observe
    from modt_profiling.comparison.prediction import forecast
    from modt_profiling.comparison.prediction_report import prediction_document, prediction_tree, read_calibration
    from modt_profiling.reporting.quantity import to_json

    request = inputs.Request.of(arguments)
    stream = inputs.stream(request)
    info = stream.info
    itself = identity(request, info)
    calibration = [read_calibration(path, itself, request.fov) for path in arguments.calibration]
    loaded = choose(request.profile, next(iter(stream), None), info).config
    share = 3 if arguments.observe == "third" and info.n_frames is not None else 1
    first = None if info.n_frames is None else -(-info.n_frames // share)
    seen = observe(request, loaded, first)
    if len(seen) < 2:
        raise MisuseError(info.name, "no two usable frames", "give a stream that modt replay can work on")
    frames = info.n_frames or len(seen)
    about = {
        **itself,
        "fov": request.fov,
        "asked": list(request.frames),
        "frames": frames,
        "seen": len(seen),
        "calibration": [name for name, _ in calibration],
        "core": pinned,
    }
    found = forecast([stream for _, stream in calibration], seen, frames, np.random.default_rng(0))
    tree = prediction_tree(found, loaded.energy.active_W, about)
    text = json.dumps(to_json(tree), indent=2)
    if arguments.out is not None:
        with writing(arguments.out):
            arguments.out.write_text(text + "\n", encoding="utf-8")
    print(text if arguments.json else prediction_document(tree).text())
    return 0
