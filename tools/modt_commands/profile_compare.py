"""`modt-profile compare`: the modes against each other on one stream."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from modt import host
from modt.cli import options


def add_parser(commands: options.Commands) -> None:
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
    core = host.pin_to_core(arguments.core)
    # NumPy is imported from here on, after the process is pinned.
    from modt.app.inputs import Request
    from modt.cli.progress import bar
    from modt_profiling.comparison.compare import compare
    from modt_profiling.comparison.compare_view import compare_document, compare_plots
    from modt_profiling.reporting.quantity import to_json
    from modt_profiling.reporting.view_extra import save

    tree = compare(
        Request.of(arguments),
        repeat=arguments.repeat,
        meter_name=arguments.meter,
        prediction=arguments.against,
        core=core,
        progress=lambda turns: bar(turns, "turn", shown=True),
    )
    document = compare_document(tree)
    if arguments.html is not None:
        save(arguments.html, document.page(compare_plots(tree)))
    print(json.dumps(to_json(tree), indent=2) if arguments.json else document.text())
    return 0
