"""Plots as SVG text: areas, lines and bars. Colours come from the style sheet of the page."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from modt.types import Float64
from modt_profiling.reporting.quantity import format_number

WIDTH, HEIGHT = 520, 230
LEFT, RIGHT, TOP, BOTTOM = 58, 14, 12, 44
CHARACTER = 10
"""Width of a digit at most, on narrow pages; labels of an axis that would touch are left out."""
_MAX_POINTS = 400
"""Points drawn of a line at most, to keep the page small."""
_LEAST_TICKS = 3
"""Least number of ticks of a logarithmic axis, where it has so many."""


@dataclass(frozen=True, slots=True)
class Trace:
    """One line, area or set of marks."""

    name: str  # in the legend
    x: Float64
    y: Float64
    dots: bool = False  # marks instead of a line
    dashed: bool = False
    colour: str = ""  # replaces the colour that its place in the plot gives it


def lines(traces: Sequence[Trace], x_label: str, y_label: str, *, log: bool = False) -> str:
    """Lines and marks over common axes, both logarithmic if log."""
    scale = _Scale.around(traces, log)
    body: list[str] = []
    for k, trace in enumerate(traces):
        x, y = scale.x(_thin(trace.x)), scale.y(_thin(trace.y))
        if trace.dots or len(trace.x) == 1:  # a line of one point cannot be seen
            body += _marks(scale, k, trace)
        else:
            dash = ' stroke-dasharray="6 4"' if trace.dashed else ""
            style = f' style="stroke:{trace.colour}"' if trace.colour else ""
            body.append(f'<polyline class="l{k}"{style}{dash} points="{_points(x, y)}"/>')
    return _frame(scale, "".join(body), x_label, y_label, [t.name for t in traces], [t.colour for t in traces])


def _marks(scale: _Scale, k: int, trace: Trace) -> Iterator[str]:
    """Circles with their values."""
    style = f' style="fill:{trace.colour}"' if trace.colour else ""
    for a, b, u, v in zip(scale.x(trace.x), scale.y(trace.y), trace.x, trace.y, strict=True):
        text = f"{escape(trace.name)}: {format_number(float(u))}, {format_number(float(v))}"
        yield f'<circle class="c{k}"{style} cx="{a:.1f}" cy="{b:.1f}" r="5"><title>{text}</title></circle>'


def areas(x: Float64, parts: dict[str, Float64], x_label: str, y_label: str, at_least: float = 0.0) -> str:
    """Parts stacked, the first at the bottom, on an axis that reaches to at_least or beyond."""
    x, drawn = _thin(x), {name: _thin(y) for name, y in parts.items()}
    tops = np.cumsum([*drawn.values()], axis=0) if drawn else np.zeros((0, len(x)))
    whole = Trace("", x, tops[-1] if len(tops) else np.zeros(len(x)))
    scale = _Scale.around([whole, Trace("", x[:1], np.array([at_least][: len(x)]))], log=False)
    body, floor = [], np.zeros(len(x))
    for k, top in enumerate(tops):
        outline = np.concatenate([scale.x(x), scale.x(x)[::-1]])
        sides = np.concatenate([scale.y(top), scale.y(floor)[::-1]])
        body.append(f'<polygon class="a{k}" points="{_points(outline, sides)}"/>')
        floor = top
    return _frame(scale, "".join(body), x_label, y_label, list(drawn))


def bars(edges: Float64, heights: Float64, x_label: str, y_label: str) -> str:
    """A histogram: (n + 1,) edges, (n,) heights."""
    outline = Trace("", edges, np.append(heights, 0.0))
    scale = _Scale.around([outline], log=False)
    x, y, floor = scale.x(edges), scale.y(heights), scale.y(np.zeros(1))[0]
    body = "".join(
        f'<rect class="a0" x="{a + 0.5:.1f}" y="{top:.1f}" width="{max(b - a - 1, 0.5):.1f}" '
        f'height="{floor - top:.1f}"><title>{format_number(u)} to {format_number(v)}: {h:g}</title></rect>'
        for a, b, top, u, v, h in zip(x[:-1], x[1:], y, edges[:-1], edges[1:], heights, strict=True)
    )
    return _frame(scale, body, x_label, y_label, [])


@dataclass(frozen=True, slots=True)
class _Scale:
    x0: float
    x1: float
    y0: float
    y1: float
    log: bool

    @classmethod
    def around(cls, traces: Sequence[Trace], log: bool) -> _Scale:
        xs = np.concatenate([t.x for t in traces]) if traces else np.zeros(1)
        ys = np.concatenate([t.y for t in traces]) if traces else np.zeros(1)
        if log:
            x0, x1 = _limits(xs[xs > 0], 1.0, 10.0)
            y0, y1 = _limits(ys[ys > 0], 1.0, 10.0)
            return cls(x0, max(x1, 1.1 * x0), y0 / 1.1, max(1.1 * y1, 1.3 * y0), True)
        (x0, x1), (y0, y1) = _limits(xs, 0.0, 1.0), _limits(ys, 0.0, 0.0)
        return cls(x0, x1 if x1 > x0 else x0 + 1.0, min(0.0, y0), 1.05 * y1 if y1 > 0 else 1.0, False)

    def x(self, value: Float64) -> Float64:
        return LEFT + (WIDTH - LEFT - RIGHT) * self._part(value, self.x0, self.x1)

    def y(self, value: Float64) -> Float64:
        return HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * self._part(value, self.y0, self.y1)

    def _part(self, value: Float64, low: float, high: float) -> Float64:
        if self.log:
            return np.asarray(np.log(np.maximum(value, low) / low) / math.log(high / low))
        return np.asarray((value - low) / (high - low))

    def ticks(self, low: float, high: float) -> list[float]:
        if self.log:
            decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
            for multiples in ((1, 2, 5), (1, 1.5, 2, 3, 5, 7), (1, 1.2, 1.4, 1.6, 1.8, 2, 2.5, 3, 4, 5, 6, 7, 8, 9)):
                steps = [m * 10.0**d for d in decades for m in multiples if low <= m * 10.0**d <= high]
                if len(steps) >= _LEAST_TICKS:
                    break
            return steps
        step = 10.0 ** math.floor(math.log10((high - low) / 3))
        step *= next(m for m in (1, 2, 5, 10) if (high - low) / (m * step) <= 6)
        first = math.ceil(low / step)
        return [step * k for k in range(first, math.floor(high / step) + 1)]


def _frame(
    scale: _Scale, body: str, x_label: str, y_label: str, legend: Sequence[str], own: Sequence[str] = ()
) -> str:
    right, floor = WIDTH - RIGHT, HEIGHT - BOTTOM
    parts = [f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(y_label)} over {escape(x_label)}">']
    for tick in scale.ticks(scale.y0, scale.y1):
        y = float(scale.y(np.array([tick]))[0])
        parts.append(f'<line class="grid" x1="{LEFT}" x2="{right}" y1="{y:.1f}" y2="{y:.1f}"/>')
        parts.append(f'<text class="end" x="{LEFT - 6}" y="{y + 4:.1f}">{tick:g}</text>')
    free = 0.0
    for tick in scale.ticks(scale.x0, scale.x1):
        x, half = float(scale.x(np.array([tick]))[0]), CHARACTER / 2 * len(f"{tick:g}")
        if x - half >= free:
            free = x + half + CHARACTER
            parts.append(f'<text class="mid" x="{x:.1f}" y="{floor + 16}">{tick:g}</text>')
    middle = (TOP + floor) / 2
    parts += [
        body,
        f'<line class="axis" x1="{LEFT}" x2="{right}" y1="{floor}" y2="{floor}"/>',
        f'<text class="mid" x="{(LEFT + right) / 2}" y="{HEIGHT - 8}">{escape(x_label)}</text>',
        f'<text class="mid" transform="translate(12 {middle}) rotate(-90)">{escape(y_label)}</text>',
        "</svg>",
    ]
    colours = {k: f' style="background:{colour}"' for k, colour in enumerate(own) if colour}
    keys = "".join(
        f'<span><i class="b{k}"{colours.get(k, "")}></i>{escape(name)}</span>'
        for k, name in enumerate(legend)
        if name
    )
    return "".join(parts) + (f'<p class="legend">{keys}</p>' if keys else "")


def _limits(values: Float64, low: float, high: float) -> tuple[float, float]:
    return (float(values.min()), float(values.max())) if len(values) else (low, high)


def _thin(values: Float64) -> Float64:
    if len(values) <= _MAX_POINTS:
        return values
    return np.asarray(values[np.linspace(0, len(values) - 1, _MAX_POINTS).astype(int)])


def _points(x: Float64, y: Float64) -> str:
    return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
