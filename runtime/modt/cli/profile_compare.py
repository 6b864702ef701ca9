"""`modt-profile compare`: the modes against each other on one stream."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from modt import host
from modt.cli.replay import core, frames
from modt.errors import MisuseError
from modt.profile import DEFAULT


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("compare", help="run the modes on the same stream, in turns")
    p.add_argument("path", nargs="?", type=Path, metavar="PATH", help="stream (default: the embedded one)")
    p.add_argument("--frames", type=frames, default=(0, None), metavar="A:B", help="frames from A up to, not with, B")
    p.add_argument("--repeat", type=times, default=3, metavar="K", help="times over (default: %(default)s)")
    p.add_argument("--profile", default=DEFAULT, metavar="NAME|FILE", help="sensor and board (default: %(default)s)")
    p.add_argument("--fov", choices=("camera", "full"), default="full", help="default: %(default)s")
    p.add_argument("--core", type=core, default="last", metavar="N|none", help="pin to core N (default: the last)")
    p.add_argument("--meter", metavar="NAME", help="meter to read (default: the best)")
    p.add_argument("--turn", type=times, metavar="N", help="frames a turn (default: 1, with a meter all)")
    p.add_argument("--json", action="store_true", help="as JSON")
    p.add_argument("--html", type=Path, metavar="FILE", help="a page with plots")
    p.set_defaults(run=run)


def times(text: str) -> int:
    """A number from 1 to 1000."""
    if not text.isdigit() or not 1 <= int(text) <= 1000:
        raise argparse.ArgumentTypeError(f"{text!r} is no count; write a whole number from 1 to 1000")
    return int(text)


def run(arguments: argparse.Namespace) -> int:
    """Compare and print."""
    pinned = host.confine(arguments.core)
    # NumPy loads from here on, after the process is confined.
    from modt import profile
    from modt.cli import assemble, metering
    from modt.cli.contenders import MODES, VARIED, Contest
    from modt.energy.conditions import Conditions
    from modt.reporting.compare_report import Basis, compare_tree
    from modt.reporting.compare_text import compare_text
    from modt.reporting.quantity import plain

    loaded = profile.load(arguments.profile)
    request = assemble.Request(
        path=arguments.path, profile=arguments.profile, fov=arguments.fov, frames=arguments.frames
    )
    contest = Contest(request, loaded, arguments.repeat, pinned, arguments.meter, arguments.turn)
    stream = assemble.stream(request)
    chosen = metering.meters(loaded.energy).choose(arguments.meter)
    assert chosen.facts is not None
    trials = []
    for number in range(arguments.repeat):
        if sys.stderr.isatty():
            print(f"\rmodt-profile: {number + 1} of {arguments.repeat}", end="", file=sys.stderr, flush=True)
        trials.append(contest.trial(number))
    if sys.stderr.isatty():
        print(file=sys.stderr)
    done = len(trials[0].contenders[0].lines)
    if not done:
        raise MisuseError(stream.info.name, "no usable frame", "give a stream that modt replay can work on")
    turn, metered = contest.turns()
    board = loaded.energy
    basis = Basis(
        idle_W=board.idle_W,
        busy_W=board.busy_W,
        period_s=stream.info.period_s,
        meter=chosen.facts.name,
        kind=chosen.facts.kind,
        coefficients=board.coefficients,
    )
    about: dict[str, Any] = {
        "stream": stream.info.name,
        "frames": done,
        "fov": request.fov,
        "repeat": arguments.repeat,
        "turn": min(turn, done),
        "basis": "as run" if metered else f"at {1 / stream.info.period_s:.0f} Hz",
        "board": board.board,
        "conditions": {**Conditions(pinned or 0).read(), "core": pinned},
        "host": host.description(),
    }
    tree = compare_tree(trials, MODES, VARIED, basis, about)
    if arguments.html is not None:
        from modt.reporting.compare_page import compare_page
        from modt.reporting.page import save

        save(arguments.html, compare_page(tree))
    print(json.dumps(plain(tree), indent=2) if arguments.json else compare_text(tree))
    return 0
