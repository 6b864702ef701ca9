"""Predictions and calibrations as files, and how far a comparison is from what was predicted."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from modt.app.assembly import MODES
from modt.errors import MisuseError
from modt.pipeline import STAGES
from modt.sinks.records import records_of
from modt.types import Int
from modt_profiling.comparison.compare_report import SCHEMA as COMPARE_SCHEMA
from modt_profiling.comparison.comparison import COUNTS
from modt_profiling.comparison.gamma import RunCosts
from modt_profiling.comparison.prediction import OBSERVED, Forecast, Stream
from modt_profiling.reporting.document import Document, Table
from modt_profiling.reporting.quantity import Quantity, estimate, from_json

SCHEMA = "modt.prediction/1"
_SEEN = (*OBSERVED, *(f"asked_{k}" for k in range(len(MODES) - 1)))
_MIN_FRAMES = 8
"""Least number of frames of a comparison that is used as a calibration."""
_INTERVAL = (
    "The interval at 95 % is over resampled frames of the calibration and of those seen, and over the calibration's "
    "own error on streams, or quarters of its only one, that it was not fitted to."
)


def read_calibration(path: Path, itself: dict[str, str | None], fov: str) -> tuple[str, Stream]:
    """Stream and runs of a comparison that was saved as JSON; not of the stream itself, by its name and path.

    Raises:
        MisuseError: no comparison, or one of the stream to be predicted, or of another field of view.
    """
    remedy = "give the output of modt-profile compare --json of another stream"
    tree = read_tree(path, COMPARE_SCHEMA, remedy)
    with records_of(path):
        if {key: tree[key] for key in itself} == itself:
            raise MisuseError(path, f"it was measured on {itself['stream']} itself", remedy)
        if tree["fov"] != fov:
            raise MisuseError(path, f"its field of view is {tree['fov']}, not {fov}", f"{remedy} with --fov {fov}")
        if tree["frames"] < _MIN_FRAMES:
            few = f"its {tree['frames']} frames are too few for unit costs"
            raise MisuseError(path, few, f"{remedy} of {_MIN_FRAMES} or more")
        runs = {
            name: RunCosts(
                np.array([table["counts"][column] for column in COUNTS], np.int64).T,
                1e-3 * np.array([table["cpu_ms"][stage] for stage in STAGES], float).T,
            )
            for name, table in tree["calibration"].items()
        }
        stream = Stream(runs, np.array([tree["observed"][column] for column in _SEEN], np.int64).T)
        _check(stream)
    return str(tree["stream"]), stream


def _check(stream: Stream) -> None:
    """Raises ValueError where the modes, their frames or their costs cannot be those of a comparison."""
    *modes, _ = stream.runs
    if modes != [*MODES]:
        raise ValueError(f"it is of the modes {modes}")
    tables = [table for run in stream.runs.values() for table in (run.counts, run.cost)] + [stream.observed]
    if len({len(table) for table in tables}) > 1:
        raise ValueError("its modes saw different frames")
    if not all((np.isfinite(table) & (table >= 0)).all() for table in tables):
        raise ValueError("a number is negative or not finite")
    if not all(run.cost.sum() > 0 for run in stream.runs.values()):
        raise ValueError("a mode took no time")


def observed_tree(observed: Int) -> dict[str, list[int]]:
    """Counts of tracking without classification (F, 7), as lists by column."""
    return dict(zip(_SEEN, observed.T.tolist(), strict=True))


def prediction_tree(found: Forecast, net_W: float, about: dict[str, Any]) -> dict[str, Any]:
    """A prediction with its interval, its rivals and what it is about (stream, frames, field of view)."""
    expected = found.expected
    values = found.expected.values.tolist()
    bounds = list(zip(found.low.tolist(), found.high.tolist(), strict=True))
    modes = [*expected.cost]
    costs = dict(zip(modes, zip(values, bounds, strict=True), strict=False))
    gammas = zip(modes[1:], values[len(modes) :], bounds[len(modes) :], found.copied[len(modes) :], strict=True)
    return {
        "schema": SCHEMA,
        **about,
        "n": estimate(expected.equation.n),
        "N_go": estimate(expected.equation.n_go, "frames"),
        "cpu_ms": {mode: estimate(value, "s", bound).scaled(1e3, "ms") for mode, (value, bound) in costs.items()},
        "net_J": {mode: estimate(value, "s", bound).scaled(net_W, "J") for mode, (value, bound) in costs.items()},
        "gamma": {
            mode: {
                "predicted": estimate(value, "", bound),
                "gamma = N_go": estimate(expected.equation.n_go),
                "Equation 3 bare": estimate(expected.equation.gamma),
                "the calibration's ratio": estimate(float(copied)),
            }
            for mode, value, bound, copied in gammas
        },
    }


def prediction_document(tree: dict[str, Any]) -> Document:
    """A prediction for people."""
    results = [
        (f"{mode}: gamma predicted", row["predicted"], f"saves {_saved(tree, mode)} a frame")
        for mode, row in tree["gamma"].items()
    ]
    about = [
        f"{tree['frames']} frames, field of view {tree['fov']}; {tree['seen']} tracked without classifying",
        f"calibrated on {', '.join(tree['calibration'])}",
        f"n {tree['n'].marked()}, N_go {tree['N_go'].marked()}",
    ]
    energy = [[f"E ({mode})", tree["net_J"][mode].scaled(1e3, "mJ"), cpu] for mode, cpu in tree["cpu_ms"].items()]
    rivals = [[name, *(row[name] for row in tree["gamma"].values())] for name in next(iter(tree["gamma"].values()))]
    tables = [
        Table(["a frame, above idling", "energy", "cpu time"], energy),
        Table(["gamma", *tree["gamma"]], rivals),
    ]
    return Document(f"Prediction for {tree['stream']}", about, results, tables, _INTERVAL)


def read_prediction(path: Path, about: dict[str, Any]) -> dict[str, Any]:
    """A prediction of a stream.

    Raises:
        MisuseError: no prediction, or one of another stream, frames or field of view than in about.
    """
    tree = read_tree(path, SCHEMA, "give a file written by modt-profile predict")
    with records_of(path):
        for key, value in about.items():
            if tree[key] != value:
                raise MisuseError(path, f"its {key} is {tree[key]!r}, not {value!r}", "compare what was predicted")
        if ([*tree["cpu_ms"]], [*tree["gamma"]]) != ([*MODES], [*MODES][1:]):
            raise ValueError(f"it is of the modes {[*tree['cpu_ms']]}")
        for plain in (*tree["cpu_ms"].values(), *(value for row in tree["gamma"].values() for value in row.values())):
            from_json(plain)
    return tree


def against(prediction: dict[str, Any], modes: dict[str, Any], savings: dict[str, Any]) -> list[dict[str, Any]]:
    """Each predicted figure and each rival of gamma, beside the measured one, with the relative error."""
    rows = [
        _row(f"cpu time, {mode}", value, modes[mode]["cpu_ms"], "ms") for mode, value in prediction["cpu_ms"].items()
    ]
    for mode, row in prediction["gamma"].items():
        gamma = savings[mode]["gamma_measured_cpu"]
        rows += [_row(f"gamma, {mode}: {name}", value, gamma) for name, value in row.items()]
    return rows


def against_table(rows: Sequence[dict[str, Any]]) -> Table:
    """Table of the differences."""
    return Table(
        ["blind prediction", "predicted", "95 %", "measured", "off by", "within"],
        [
            [
                row["name"],
                row["predicted"],
                row["predicted"].interval() or "-",
                row["measured"],
                row["off"].scaled(100, "%"),
                {True: "yes", False: "NO", None: "-"}[row["within"]],
            ]
            for row in rows
        ],
    )


def _row(name: str, plain: dict[str, Any], measured: Quantity, unit: str = "") -> dict[str, Any]:
    predicted = from_json(plain | {"unit": unit})
    true = measured.value
    low = predicted.low
    high = predicted.high
    off = None if predicted.value is None or not true else predicted.value / true - 1.0
    within = None if low is None or high is None or true is None else low <= true <= high
    return {"name": name, "predicted": predicted, "measured": measured, "off": estimate(off), "within": within}


def _saved(tree: dict[str, Any], mode: str) -> str:
    e1 = next(iter(tree["net_J"].values())).value
    e2 = tree["net_J"][mode].value
    return estimate(1e3 * (e1 - e2), "mJ").marked()


def read_tree(path: Path, schema: str, remedy: str) -> dict[str, Any]:
    """A report that was saved as JSON.

    Raises:
        MisuseError: it cannot be read, or is of another schema.
    """
    try:
        tree = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, RecursionError, ValueError) as error:
        raise MisuseError(path, f"cannot be read ({error})", remedy) from None
    if not isinstance(tree, dict) or tree.get("schema") != schema:
        raise MisuseError(path, f"it is no {schema}", remedy)
    return tree
