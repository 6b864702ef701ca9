"""The points of a proposal, from the side and from the top, as SVG."""

from __future__ import annotations

import numpy as np

from modt.types import Float32, Float64
from modt_desk.evaluation.overlap import inside

METRE = 80
"""Pixels a metre."""
MARGIN_M = 0.02
"""Margin around the box, because recorded boxes are rounded."""
MOST = 600
"""Most points drawn."""
_STYLE = 'style="display:inline-block;width:auto;max-width:100%;margin-right:24px;overflow:visible"'


def crop_picture(box: list[float], points: Float32) -> str:
    """Two pictures of the points in a box: x, y, z of its centre, l, w, h [m], yaw [rad]."""
    x, y, z, length, width, height, yaw = box
    held = points[inside(points, np.array(box), MARGIN_M, -MARGIN_M), :3].astype(np.float64)
    held = held[np.linspace(0, len(held) - 1, min(len(held), MOST)).astype(np.int64)] - [x, y, z]
    c, s = np.cos(yaw), np.sin(yaw)
    along, across = c * held[:, 0] + s * held[:, 1], c * held[:, 1] - s * held[:, 0]
    side = _picture(np.stack([along, -held[:, 2]], axis=1), length, height, "from the side")
    return side + _picture(np.stack([along, -across], axis=1), length, width, "from the top")


def _picture(uv: Float64, length: float, height: float, name: str) -> str:
    wide, high = METRE * (length + 0.4), METRE * (height + 0.4)
    dots = "".join(f'<circle class="c0" cx="{u:.1f}" cy="{v:.1f}" r="1.5"/>' for u, v in (METRE * uv).tolist())
    frame = (
        f'<rect fill="none" class="grid" x="{-METRE * length / 2:.1f}" y="{-METRE * height / 2:.1f}" '
        f'width="{METRE * length:.1f}" height="{METRE * height:.1f}"/>'
    )
    wide = max(wide, 130)
    view = f"{-wide / 2:.1f} {-high / 2:.1f} {wide:.1f} {high + 18:.1f}"
    caption = f'<text class="mid" y="{high / 2 + 12:.1f}">{name}</text>'
    size = f'width="{wide:.0f}" height="{high + 18:.0f}"'
    return f'<svg {_STYLE} {size} viewBox="{view}" role="img">{frame}{dots}{caption}</svg>'
