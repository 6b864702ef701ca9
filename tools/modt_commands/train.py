"""`modt train`: own labels and own classes, from labelled recordings to a model with its card and a profile."""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

from modt import host
from modt.cli import options
from modt.cli.progress import bar
from modt.errors import MisuseError, ModtError, install

STEPS = 1500


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("train", help="train the classifiers on labelled recordings of your own (extra train)")
    labelled = "labelled recordings, two or more: what modt evaluate takes as labels"
    p.add_argument("recordings", nargs="+", type=Path, metavar="RECORDING", help=labelled)
    beside = "labels of each recording, in their order (default: those beside it)"
    p.add_argument("--labels", nargs="+", action="extend", type=Path, default=[], metavar="TRUTH", help=beside)
    options.add(p, "profile")
    p.add_argument("--out", type=Path, required=True, metavar="FOLDER", help="folder of the model and its profile")
    p.add_argument("--name", default="own", help="name of the model and the profile (default: %(default)s)")
    steps = options.bounded(int, 10, 1_000_000, "steps")
    p.add_argument("--steps", type=steps, default=STEPS, metavar="N", help="of each network (default: %(default)s)")
    worlds = options.bounded(int, 1, 1000, "a count")
    p.add_argument("--worlds", type=worlds, metavar="N", help="simulated worlds that keep the shipped classes (192)")
    p.add_argument("--quiet", action="store_true", help="no progress")
    options.add_examples(
        p,
        "modt train DRIVES/* --profile vlp-16 --out models/own        labels beside the recordings",
        "modt train a b --labels a-truth b-truth --out models/own     labels elsewhere",
        "modt train DRIVES/* --name dogs --out models/dogs            with the classes of MODT_CLASSES",
    )
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Train.

    Raises:
        MisuseError: recordings, labels or a profile cannot be used, examples are missing, or so is the extra.
        ModtError: the folder cannot be written.
    """
    host.pin_to_core(None)  # one thread: NumPy is imported from here on
    try:
        from modt_training.own_labels import KEPT_SCENES, KEPT_SEEDS, Request, train
    except ModuleNotFoundError as error:
        raise MisuseError("modt train", f"needs {error.name}", install("train")) from None

    if not re.fullmatch(r"[\w-]+", arguments.name):
        raise MisuseError("--name", f"{arguments.name!r} is no name", "use letters, digits, - and _")
    seeds = -(-arguments.worlds // len(KEPT_SCENES)) if arguments.worlds else KEPT_SEEDS
    request = Request(
        recordings=arguments.recordings,
        labels=arguments.labels,
        profiles=arguments.profile,
        out=arguments.out,
        name=arguments.name,
        steps=arguments.steps,
        kept_seeds=seeds,
    )
    try:
        with bar(request.n_pieces, "step", shown=not arguments.quiet) as step:
            lines = train(request, step)
    except OSError as error:
        cause = f"cannot be written ({error.strerror or error})"
        raise ModtError(arguments.out, cause, "free or unlock the disk, or give another --out") from None
    print("\n".join(lines), file=sys.stdout)
    return 0
