"""`modt-profile predict`: what the modes will cost on a stream, before any of them runs on it."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from modt import host
from modt.cli import options


def add_parser(commands: options.Commands) -> None:
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
    core = host.pin_to_core(arguments.core)
    # NumPy is imported from here on, after the process is pinned.
    from modt.app.inputs import Request
    from modt.sinks.output import writing
    from modt_profiling.comparison.predict import predict
    from modt_profiling.comparison.prediction_report import prediction_document
    from modt_profiling.reporting.quantity import to_json

    observe_all = arguments.observe == "all"
    tree = predict(Request.of(arguments), arguments.calibration, observe_all=observe_all, core=core)
    text = json.dumps(to_json(tree), indent=2)
    if arguments.out is not None:
        with writing(arguments.out):
            arguments.out.write_text(text + "\n", encoding="utf-8")
    print(text if arguments.json else prediction_document(tree).text())
    return 0
