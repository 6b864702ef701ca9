"""The whole prediction for one stream, from the request to the tree of its report."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from modt.app import inputs
from modt.app.chosen_profile import choose
from modt.errors import MisuseError
from modt.profile import resolve
from modt_profiling.comparison.mode_runs import identity, observe
from modt_profiling.comparison.prediction import forecast
from modt_profiling.comparison.prediction_report import prediction_tree, read_calibration

_THIRD = 3
"""One frame in so many is tracked without classification, where not all are."""


def predict(
    request: inputs.Request, calibrations: Sequence[Path], *, observe_all: bool, core: int | None
) -> dict[str, Any]:
    """Track a part of the stream without classifying, and predict the costs of the modes on all of it.

    Args:
        request: stream, profile and field of view.
        calibrations: comparisons of other streams, saved as JSON.
        observe_all: whether all frames are tracked, not the first third.
        core: core that the process is pinned to.

    Raises:
        MisuseError: fewer than two usable frames, or a calibration that cannot be used.
    """
    stream = inputs.stream(request)
    info = stream.info
    itself = identity(request, info)
    calibration = [read_calibration(path, itself, request.fov) for path in calibrations]
    profile = choose(resolve(request.profile), next(iter(stream), None), info).config
    first = info.n_frames
    if first is not None and not observe_all:
        first = -(-first // _THIRD)
    seen = observe(request, profile, first)
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
        "core": core,
    }
    found = forecast([stream for _, stream in calibration], seen, frames, np.random.default_rng(0))
    return prediction_tree(found, profile.energy.active_W, about)
