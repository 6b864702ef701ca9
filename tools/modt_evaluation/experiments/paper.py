"""The figures of the paper."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

ALL_DRIVES = "the paper's eight drives"
DRIVES = ("0001", "0005", "0014", "0019", "0020", "0035", "0059", "0084")
_TABLE_III = (32.4, 34.9, 27.1, 46.3, 56.6, 36.4, 61.9, 51.7)
_TABLE_VI = {
    "objects": (14, 12, 35, 23, 7, 21, 57, 53),
    "frames": (108, 154, 341, 481, 86, 131, 373, 383),
    "mis-associations": (0, 0, 5, 3, 0, 0, 23, 0),
    "discontinuities": (33, 38, 26, 53, 39, 47, 94, 125),
    "N_go of objects": (5.0, 4.6, 7.9, 7.9, 5.4, 5.3, 9.7, 8.4),
}
_OF_DRIVE: dict[tuple[str, str, str], float] = {
    ("table3", drive, "N_go"): value for drive, value in zip(DRIVES, _TABLE_III, strict=True)
} | {
    ("table6", drive, quantity): value
    for quantity, values in _TABLE_VI.items()
    for drive, value in zip(DRIVES, values, strict=True)
}
_OF_ALL: dict[tuple[str, str, str], float] = {
    (table, method, f"AP {name}"): percent / 100
    for table, method, percents in (
        ("table4", "det_only", (92.2, 90.4, 54.4)),
        ("table4", "with_trk", (97.4, 96.8, 79.3)),
        ("table5", "det_only", (92.0, 89.6, 57.5)),
        ("table5", "with_trk", (93.8, 91.2, 73.0)),
    )
    for name, percent in zip(("car", "cyclist", "pedestrian"), percents, strict=True)
}
_OF_RANGE = {("fig8", 10.0, "beta"): 0.1, ("fig8", 70.0, "beta"): 0.02}


def figure(experiment: str, streams: str, variant: str, at: float | None, quantity: str) -> tuple[float, str] | None:
    """The paper's value of a figure, and the drives that it is taken over. None where the paper does not state it."""
    drive = streams[:4]
    if at is not None and streams.endswith("drives"):
        found = _OF_RANGE.get((experiment, at, quantity))
    elif (experiment, drive, quantity) in _OF_DRIVE:
        return _OF_DRIVE[experiment, drive, quantity], drive
    else:
        found = _OF_ALL.get((experiment, variant, quantity))
    return None if found is None else (found, ALL_DRIVES)


@dataclass(frozen=True)
class Mark:
    """Statements of the paper about a figure, whose curve is an image there and known at few places.

    Attributes:
        words: what it is.
        at: value that is swept, None for a level all along.
        value: value of the quantity, None for a place alone.
    """

    words: str
    at: float | None
    value: float | None


_TENFOLD = 10.0
"""Calls of the network with a real detector over those with an ideal one, "about ten times"."""
_OPTIMA = {"AP pedestrian": 0.16, "AP cyclist": 0.22}
"""Best alpha of a class; that of cars hardly matters."""
_BEST_START = 4.0
"""Starting frame that discards the first three frames."""
_TABLE_OF = {"fig9": "table4", "fig10": "table4", "fig11": "table4", "fig14": "table5"}
"""Table that has the average precision of the curves of a figure."""


def marks(experiment: str, quantity: str) -> Iterator[Mark]:
    """Statement of the paper about a quantity of a figure."""
    if quantity == "beta":
        yield from _betas(experiment)
    table = _TABLE_OF.get(experiment)
    name = quantity.removeprefix("precision ")
    if table is None:
        return
    for method in ("det_only", "with_trk"):
        value = _OF_ALL.get((table, method, quantity))
        if value is not None:
            yield Mark(f"paper, {method}", None, value)
        elif name != quantity:
            area = _OF_ALL[table, method, f"AP {name}"]
            yield Mark(f"The area below the paper's curve {method} is {area:.3f}", None, None)
    if experiment == "fig10" and quantity in _OPTIMA:
        yield Mark("paper, best", _OPTIMA[quantity], None)
    if experiment == "fig11":
        yield Mark("paper, best", _BEST_START, None)


def _betas(experiment: str) -> Iterator[Mark]:
    if experiment in ("fig8", "fig12"):
        times = 1.0 if experiment == "fig8" else _TENFOLD
        words = "paper" if experiment == "fig8" else "paper, ten times Fig. 8"
        for (_, range_m, _), beta in _OF_RANGE.items():
            yield Mark(words, range_m, times * beta)
    elif experiment == "fig13":
        yield Mark("paper, 1 / N_go of Table VI", None, _tracks() / _followed())


def _tracks() -> float:
    """Tracks of objects in Table VI."""
    return float(sum(_TABLE_VI["objects"]) + sum(_TABLE_VI["discontinuities"]))


def _followed() -> float:
    """Frames in which objects are followed in Table VI."""
    columns = (_TABLE_VI[name] for name in ("objects", "discontinuities", "N_go of objects"))
    return float(sum((objects + breaks) * n_go for objects, breaks, n_go in zip(*columns, strict=True)))
