"""Gamma over several comparisons."""

import json
import re
from xml.etree import ElementTree

import pytest

from modt.errors import MisuseError
from modt_desk.comparison.compare_report import SCHEMA
from modt_desk.comparison.regimes import BLIND, regimes_tree
from modt_desk.comparison.regimes_view import regimes_document, regimes_plots
from modt_desk.reporting.page import document_page
from modt_desk.reporting.quantity import estimate, quantity, to_json
from modt_desk.reporting.svg import HEIGHT, LEFT, WIDTH


def write(folder, name, share, gamma, predicted=None, **changed):
    savings = {
        "gamma_measured_cpu": quantity(gamma, interval=(0.9 * gamma, 1.1 * gamma)),
        "gamma_short": estimate(4 * gamma),
        "gamma_equation_3": estimate(1.5 * gamma),
    }
    frame = {"cpu_ms": quantity(10.0, "ms"), "stages": {"classification": {"cpu_ms": quantity(10.0 * share, "ms")}}}
    tree = {
        "schema": SCHEMA,
        "stream": "street",
        "fov": "full",
        "modes": {"conventional": frame},
        "savings": dict.fromkeys(("efficient", "accurate"), savings),
    }
    if predicted is not None:
        blind = estimate(predicted, "", (0.5 * predicted, 2 * predicted))
        tree["against"] = [{"name": f"gamma, {mode}: predicted", "predicted": blind} for mode in tree["savings"]]
    path = folder / f"{name}.json"
    path.write_text(json.dumps(to_json(tree | changed)))
    return path


@pytest.fixture
def tree(tmp_path):
    return regimes_tree([write(tmp_path, "dear", 0.8, 3.0, 2.7), write(tmp_path, "cheap", 0.4, 1.2)])


def test_every_mode_of_every_comparison_has_what_was_said_of_it(tree):
    assert [(row["name"], row["mode"]) for row in tree["regimes"]] == [
        (name, mode) for name in ("dear", "cheap") for mode in ("efficient", "accurate")
    ]
    dear, cheap = tree["regimes"][0], tree["regimes"][2]
    assert (dear["share"].value, dear["gamma"].low) == pytest.approx((0.8, 2.7))
    assert {name: said.value for name, said in dear["said"].items()} == pytest.approx(
        {"gamma = N_go": 12.0, "Equation 3": 4.5, BLIND: 2.7}
    )
    assert BLIND not in cheap["said"]


def test_errors_are_told_and_the_least_gamma_comes_first(tree):
    document = regimes_document(tree)
    name, gamma, note = document.results[0]
    assert (name, gamma.value) == ("efficient: gamma, median", pytest.approx(2.1))
    assert note.endswith("gamma = N_go 300 %, Equation 3 50 %, blind prediction 10 %")
    assert [row[0] for row in document.tables[0].rows] == ["cheap", "dear"]
    assert document.tables[0].rows[1][-1] == "~2.70 (1.35 to 5.40)"


def test_dots_stand_where_their_figures_are_with_their_intervals(tree):
    plots = [ElementTree.fromstring(svg.partition("</svg>")[0] + "</svg>") for _, svg, _ in regimes_plots(tree)]
    assert len(plots) == 3
    for plot in plots:
        for dot in plot.iter("circle"):
            assert LEFT <= float(dot.get("cx")) <= WIDTH
            assert 0 <= float(dot.get("cy")) <= HEIGHT
    said = {dot.findtext("title"): dot for dot in plots[1].iter("circle")}
    measured, blind = said["measured, dear: 3.00, 3.00"], said["blind prediction, dear: 3.00, 2.70"]
    assert measured.get("cx") == blind.get("cx")
    assert float(measured.get("cy")) < float(blind.get("cy"))  # the prediction is too low
    (interval,) = (
        line for line in plots[1].iter("line") if line.get("class") == "l3" and line.get("y1") != line.get("y2")
    )
    assert float(interval.get("y2")) < float(blind.get("cy")) < float(interval.get("y1"))


def test_the_page_needs_nothing_from_outside(tree):
    page = document_page(regimes_document(tree), regimes_plots(tree))
    assert not re.search(r"(src|href)=|url\(|https?://|nan|inf\b", page)


@pytest.mark.parametrize(
    "changed", [{"schema": "modt.prediction/1"}, {"modes": {}}, {"savings": {}}, {"savings": {"efficient": {}}}]
)
def test_what_is_no_comparison_is_named(tmp_path, changed):
    with pytest.raises(MisuseError, match=r"broken\.json.*comparison|broken\.json.*modt\.compare"):
        regimes_tree([write(tmp_path, "broken", 0.5, 2.0, **changed)])
