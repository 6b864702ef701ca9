"""A track's points from above and from the side over some of its frames, as one picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from modt.sinks.output import writing
from modt.sources.stream import Stream
from modt.types import Float32, Float64
from modt.viewer.theme import COLOURS, LIGHT
from modt_desk.evaluation.overlap import inside
from modt_desk.evaluation.run_record import FramesByNumber
from modt_desk.evaluation.unlabelled import Mover

PICTURES = 10
ROOM_M = 1.0
"""Margin shown around the box."""
SIDE_IN, DPI = 1.4, 100
SHADES = LIGHT["soft"], COLOURS[0]
"""Colours of points beside the box and in it."""


def save_film_strips(folder: Path, movers: Sequence[Mover], stream: Stream) -> None:
    """Write track-N.png of each mover, with up to PICTURES of its frames.

    Raises:
        ModtError: one cannot be written.
    """
    shown = [np.unique(np.linspace(0, len(m.frame) - 1, PICTURES).astype(int)).tolist() for m in movers]
    asked = sorted((int(mover.frame[k]), n, k) for n, mover in enumerate(movers) for k in shown[n])
    sweeps = FramesByNumber(stream)
    crops: list[list[tuple[int, Float32]]] = [[] for _ in movers]
    for number, n, k in asked:
        sweep = sweeps.get(number)
        if sweep is not None:
            crops[n].append((k, _around(sweep.points, movers[n].box[k])))
    for mover, own in zip(movers, crops, strict=True):
        path = folder / f"track-{mover.track}.png"
        with writing(path):
            _strip(mover, own).savefig(path, metadata={"Software": None})


def _around(points: Float32, box: Float64) -> Float32:
    reach_m = _reach_m(box)
    return points[inside(points, box, reach_m, -reach_m)]


def _reach_m(box: Float64) -> float:
    """Half the side of a picture."""
    return float(box[3:6].max()) / 2 + ROOM_M


def _strip(mover: Mover, crops: Sequence[tuple[int, Float32]]) -> Figure:
    figure = Figure((SIDE_IN * len(crops), 2.5 * SIDE_IN), DPI, facecolor=LIGHT["paper"], layout="constrained")
    style = {"color": LIGHT["ink"], "fontsize": 9}
    rows = figure.subplots(2, len(crops), squeeze=False)
    for (k, points), above, side in zip(crops, *rows, strict=True):
        box = mover.box[k]
        c, s = np.cos(box[6]), np.sin(box[6])
        x, y, z = (points[:, :3] - box[:3]).T
        colour = np.where(inside(points, box), *SHADES[::-1])
        along = c * x + s * y
        for axes, v, height in ((above, c * y - s * x, box[4]), (side, z, box[5])):
            _outline(axes, box[3], height, _reach_m(box))
            axes.scatter(along, v, s=4, c=colour, linewidths=0)
        above.set_title(f"{mover.frame[k]}, {np.hypot(*box[:2]):.0f} m", **style)
    for axes, name in zip(rows[:, 0], ("from above", "from the side"), strict=True):
        axes.set_ylabel(name, **style)
    return figure


def _outline(axes: Axes, length: float, height: float, reach: float) -> None:
    """The box about the origin, and what is shown around it."""
    u, v = np.array([-1, 1, 1, -1, -1]) * length / 2, np.array([-1, -1, 1, 1, -1]) * height / 2
    axes.plot(u, v, color=LIGHT["line"], linewidth=1)
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal", xticks=[], yticks=[])
