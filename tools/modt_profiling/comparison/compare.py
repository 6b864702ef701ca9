"""The whole comparison of the modes on one stream, from the request to the tree of its report."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import Any

from modt import host
from modt.app import inputs
from modt.app.chosen_profile import choose
from modt.energy.meters.discovery import discover
from modt.energy.meters.meter import Conditions, Kind
from modt.errors import MisuseError
from modt.profile import resolve
from modt_profiling.comparison.compare_report import Basis, compare_tree
from modt_profiling.comparison.mode_runs import MODES, VARIED, Comparison, identity, observe
from modt_profiling.comparison.prediction_report import against, observed_tree, read_prediction
from modt_profiling.energy.named_meter import choose_meter

Progress = Callable[[int | None], AbstractContextManager[Callable[[str], None]]]


def compare(
    request: inputs.Request,
    *,
    repeat: int,
    meter_name: str | None,
    prediction: Path | None,
    core: int | None,
    progress: Progress,
) -> dict[str, Any]:
    """Run all modes, interleaved, and report them.

    Args:
        request: stream, profile and field of view.
        repeat: number of repetitions.
        meter_name: meter to read; None for the best.
        prediction: file of a prediction to hold against the measurement.
        core: core that the process is pinned to.
        progress: from the number of turns of the modes, or None where it is unknown, a context with the function that
            is called after each turn.

    Raises:
        MisuseError: no usable frame, no such meter, or a prediction of something else.
    """
    stream = inputs.stream(request)
    info = stream.info
    asked = {**identity(request, info), "fov": request.fov, "asked": list(request.frames)}
    predicted = None if prediction is None else read_prediction(prediction, asked)
    profile = choose(resolve(request.profile), next(iter(stream), None), info).config
    meters = choose_meter(discover(profile.energy), meter_name).meters
    metered = meters[0].facts.kind is not Kind.ESTIMATED
    comparison = Comparison(request, profile, core, meters if metered else ())
    turns = None if info.n_frames is None else repeat * comparison.turns(info.n_frames)
    with progress(turns) as end_turn:
        numbers = range(1, repeat + 1)
        repetitions = [comparison.repetition(partial(end_turn, f"repetition {n} of {repeat}")) for n in numbers]
    frames = len(repetitions[0][VARIED].lines)
    if not frames:
        raise MisuseError(info.name, "no usable frame", "give a stream that modt replay can work on")
    about: dict[str, Any] = {
        **identity(request, info),
        "frames": frames,
        "fov": request.fov,
        "repeat": repeat,
        "turn": min(comparison.turn_frames, frames),
        "basis": "as run" if metered else f"at {1 / info.period_s:.0f} Hz",
        "board": profile.energy.board,
        "conditions": {**Conditions(core or 0).read(), "core": core},
        "host": host.description(),
    }
    basis = Basis(profile.energy, meters[0].facts, info.period_s)
    tree = compare_tree(repetitions, MODES, VARIED, basis, about)
    tree["observed"] = observed_tree(observe(request, profile, None))
    if predicted is not None:
        tree["against"] = against(predicted, tree["modes"], tree["savings"])
    return tree
