"""Gamma over several comparisons: measured, by the paper's formulas, predicted, and what sets it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from modt.errors import MisuseError
from modt.pipeline import CLASSIFICATION
from modt_desk.comparison.compare_report import SCHEMA as COMPARE_SCHEMA
from modt_desk.comparison.prediction_report import read_tree
from modt_desk.reporting.quantity import Quantity, from_json, quantity

SCHEMA = "modt.regimes/1"
FORMULAS = {"gamma = N_go": "gamma_short", "Equation 3": "gamma_equation_3"}
"""The paper's, and where a comparison has them: by the counts and costs of its own runs."""
BLIND = "blind prediction"


def regimes_tree(paths: Sequence[Path]) -> dict[str, Any]:
    """Of every comparison and mode: gamma, what was said of it, and the share of classification in a frame's energy.

    Raises:
        MisuseError: a file is no comparison, or one in which nothing was tracked.
    """
    return {"schema": SCHEMA, "regimes": [row for path in paths for row in _regimes(path)]}


def _regimes(path: Path) -> Iterator[dict[str, Any]]:
    """Of each mode but tracking-by-detection."""
    remedy = "give the output of modt-profile compare --json"
    tree = read_tree(path, COMPARE_SCHEMA, remedy)
    try:
        frame = next(iter(tree["modes"].values()))
        share = frame["stages"][CLASSIFICATION]["cpu_ms"]["value"] / frame["cpu_ms"]["value"]
        if not tree["savings"]:
            raise ValueError("of no mode")
        blind = {row["name"]: row["predicted"] for row in tree.get("against", ())}
        for mode, saving in tree["savings"].items():
            said = {name: _known(saving[key]) for name, key in FORMULAS.items()}
            predicted = blind.get(f"gamma, {mode}: predicted")
            yield {
                "name": path.stem,
                "stream": tree["stream"],
                "fov": tree["fov"],
                "mode": mode,
                "share": quantity(share),
                "gamma": _known(saving["gamma_measured_cpu"]),
                "said": said if predicted is None else said | {BLIND: _known(predicted)},
            }
    except (KeyError, TypeError, ValueError, AttributeError, ZeroDivisionError, StopIteration) as error:
        raise MisuseError(path, f"it is no whole comparison ({error!r})", remedy) from None


def _known(plain: dict[str, Any]) -> Quantity:
    found = from_json(plain)
    if found.value is None:
        raise ValueError("unavailable")
    return found
