"""Points of a proposal or a track, from the side and from the top, and a page of the tracks without a label."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from modt.sources.stream import Stream
from modt.types import Bool, Float32, Float64
from modt_evaluation.overlap import inside
from modt_evaluation.run_record import FramesByNumber
from modt_evaluation.unlabelled import Mover
from modt_profiling.reporting.document import Page, Plot, Section

if TYPE_CHECKING:  # Matplotlib is an extra
    from matplotlib.axes import Axes

MARGIN_M = 0.02
"""Margin around the box, because recorded boxes are rounded."""
MAX_POINTS = 600
"""Greatest number of points drawn."""
MAX_PICTURES = 10
"""Greatest number of frames drawn of a track without a label."""
SURROUNDINGS_M = 1.0
"""Margin shown around the box of a track without a label."""
INCH_PER_M = 0.8
"""Scale of the pictures."""
EDGE_IN = 0.4
"""Room around the points for the title of a picture."""
MIN_WIDTH_IN = 1.4
"""Least width of a picture, which its title needs."""


def crop_pictures(
    box: Sequence[float], points: Float32, around_m: float = MARGIN_M, inch_per_m: float = INCH_PER_M
) -> list[Plot]:
    """Two pictures of the points in a box and around it.

    Args:
        box: x, y, z of its centre, l, w, h [m], yaw [rad].
        points: (N, 4) points of the sweep.
        around_m: distance from the box up to which points are drawn.
        inch_per_m: scale.
    """
    x, y, z, length, width, height, yaw = box
    near = points[inside(points, np.array(box), around_m, -around_m), :3].astype(np.float64)
    drawn = near[np.linspace(0, len(near) - 1, min(len(near), MAX_POINTS)).astype(np.int64)]
    in_box = inside(drawn, np.array(box), MARGIN_M, -MARGIN_M)
    offset = drawn - [x, y, z]
    along = np.cos(yaw) * offset[:, 0] + np.sin(yaw) * offset[:, 1]
    across = np.cos(yaw) * offset[:, 1] - np.sin(yaw) * offset[:, 0]
    return [
        _picture("from the side", np.stack([along, offset[:, 2]], axis=1), in_box, (length, height), inch_per_m),
        _picture("from the top", np.stack([along, across], axis=1), in_box, (length, width), inch_per_m),
    ]


def _picture(title: str, uv: Float64, in_box: Bool, size: tuple[float, float], inch_per_m: float) -> Plot:
    """The (n, 2) points uv [m] about the centre of a box of a size [m], in grey those that lie outside it."""
    extent_m = np.maximum(2 * np.abs(uv).max(axis=0, initial=0.0), size)
    width_in, height_in = (inch_per_m * extent_m + EDGE_IN).tolist()

    def draw(axes: Axes) -> None:
        axes.set_axis_off()
        axes.set_aspect("equal")
        axes.set_title(title)
        left = -size[0] / 2
        low = -size[1] / 2
        axes.plot([left, -left, -left, left, left], [low, low, -low, -low, low], color="C5", linewidth=0.5)
        for colour, shown in (("C0", in_box), ("C5", ~in_box)):
            axes.plot(uv[shown, 0], uv[shown, 1], ".", color=colour, markersize=2.5)

    return Plot("", "", draw, (max(width_in, MIN_WIDTH_IN), height_in))


def mover_page(movers: Sequence[Mover], stream: Stream) -> Page:
    """Page with up to MAX_PICTURES frames of each track without a label."""
    shown = [np.unique(np.linspace(0, len(m.frame) - 1, MAX_PICTURES).astype(int)).tolist() for m in movers]
    wanted = sorted((int(mover.frame[k]), n, k) for n, mover in enumerate(movers) for k in shown[n])
    sections: list[list[Section]] = [[Section(f"Track {mover.track}")] for mover in movers]
    sweeps = FramesByNumber(stream)
    for number, n, k in wanted:
        sweep = sweeps.get(number)
        if sweep is not None:
            box = movers[n].box[k].tolist()
            title = f"Frame {number}, {np.hypot(*box[:2]):.0f} m away"
            pictures = crop_pictures(box, sweep.points, SURROUNDINGS_M, INCH_PER_M / 2)
            sections[n].append(Section(lines=[title], pictures=pictures))
    about = f"{stream.info.name}: points in the box, and grey those around"
    title = "Tracks that move like road users and have no label"
    return Page(title, about, [section for of_mover in sections for section in of_mover])
