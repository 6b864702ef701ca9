"""Points of a proposal or a track, from the side and from the top, as SVG, and a page of those without a label."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from modt.sources.stream import Stream
from modt.types import Bool, Float32, Float64
from modt_evaluation.overlap import inside
from modt_evaluation.run_record import FramesByNumber
from modt_evaluation.unlabelled import Mover
from modt_profiling.reporting.document import page, save

MARGIN_M = 0.02
"""Margin around the box, because recorded boxes are rounded."""
MOST = 600
"""Most points drawn."""
PICTURES, ROOM_M = 10, 1.0
"""Frames drawn of a track without a label, and the margin shown around its box."""
_STYLE = 'style="display:inline-block;width:auto;max-width:100%;margin-right:24px;overflow:visible"'


def crop_picture(box: Sequence[float], points: Float32, room_m: float = MARGIN_M, metre_px: float = 80.0) -> str:
    """Two pictures of the points in a box and up to room_m around: x, y, z of its centre, l, w, h [m], yaw [rad]."""
    x, y, z, length, width, height, yaw = box
    held = points[inside(points, np.array(box), room_m, -room_m), :3].astype(np.float64)
    held = held[np.linspace(0, len(held) - 1, min(len(held), MOST)).astype(np.int64)]
    own, placed = inside(held, np.array(box), MARGIN_M, -MARGIN_M), held - [x, y, z]
    c, s = np.cos(yaw), np.sin(yaw)
    along, across = c * placed[:, 0] + s * placed[:, 1], c * placed[:, 1] - s * placed[:, 0]
    views = ((-placed[:, 2], height, "from the side"), (-across, width, "from the top"))
    return "".join(
        _picture(metre_px * np.stack([along, v], axis=1), own, metre_px * np.array([length, tall]), name)
        for v, tall, name in views
    )


def _picture(uv: Float64, own: Bool, size: Float64, name: str) -> str:
    wide, high = np.maximum(2 * np.abs(uv).max(axis=0, initial=0.0), size) + 32.0
    dots = "".join(
        f'<circle class="c{0 if inner else 5}" cx="{u:.1f}" cy="{v:.1f}" r="1.5"/>'
        for (u, v), inner in zip(uv.tolist(), own.tolist(), strict=True)
    )
    frame = (
        f'<rect fill="none" class="grid" x="{-size[0] / 2:.1f}" y="{-size[1] / 2:.1f}" '
        f'width="{size[0]:.1f}" height="{size[1]:.1f}"/>'
    )
    wide = max(wide, 130)
    view = f"{-wide / 2:.1f} {-high / 2:.1f} {wide:.1f} {high + 18:.1f}"
    caption = f'<text class="mid" y="{high / 2 + 12:.1f}">{name}</text>'
    extent = f'width="{wide:.0f}" height="{high + 18:.0f}"'
    return f'<svg {_STYLE} {extent} viewBox="{view}" role="img">{frame}{dots}{caption}</svg>'


def save_mover_page(path: Path, movers: Sequence[Mover], stream: Stream) -> None:
    """Write a page with up to PICTURES frames of each track without a label.

    Raises:
        ModtError: it cannot be written.
    """
    shown = [np.unique(np.linspace(0, len(m.frame) - 1, PICTURES).astype(int)).tolist() for m in movers]
    asked = sorted((int(mover.frame[k]), n, k) for n, mover in enumerate(movers) for k in shown[n])
    blocks, sweeps = [f"<h2>Track {mover.track}</h2>" for mover in movers], FramesByNumber(stream)
    for number, n, k in asked:
        sweep, box = sweeps.get(number), movers[n].box[k].tolist()
        if sweep is not None:
            title = f"Frame {number}, {np.hypot(*box[:2]):.0f} m away"
            blocks[n] += f"<p>{title}</p>{crop_picture(box, sweep.points, ROOM_M, 40.0)}"
    about = f"{stream.info.name}: points in the box, and grey those around"
    save(
        path,
        page(
            "Tracks that move like road users and have no label", about, (f"<section>{b}</section>" for b in blocks)
        ),
    )
