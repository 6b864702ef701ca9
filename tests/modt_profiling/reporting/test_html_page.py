"""Pages of reports and their plots."""

import json
import re
import sys
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from modt.app.deadlines import Deadlines
from modt.errors import MisuseError
from modt.sinks.run_directory import SUMMARY
from modt_profiling.reporting.document import Page, Plot, Section
from modt_profiling.reporting.energy_plots import stage_energy
from modt_profiling.reporting.html_page import html, svg
from modt_profiling.reporting.quantity import Quantity
from modt_profiling.reporting.run_report import lateness_plots, run_document, run_plots, run_tree
from modt_profiling.reporting.view_extra import save
from tests.viewer.chromium import LOADED, WIDE


def drawn(plot):
    """Axes with a plot."""
    figure = pytest.importorskip("matplotlib.figure").Figure()
    axes = figure.add_subplot()
    plot.draw(axes)
    return axes


def test_a_page_is_one_file_without_an_unescaped_name(run):
    tree = run_tree(run) | {"stream": "<b>street</b>"}
    text = html(run_document(tree).page(run_plots(tree)))
    assert "<b>street" not in text
    assert not re.search(r"\b(src|href)=\"(?!#)|@import|url\((?!#)|https?://(?!www\.w3\.org)", text)
    plots = re.findall(r"<svg.*?</svg>", text, re.S)
    assert len(plots) > 3
    for plot in plots:
        assert ElementTree.fromstring(plot).attrib["viewBox"]
        assert not re.search(r"\bnan|inf\b", plot)


SCROLLED = "[...document.querySelectorAll('.table, .text')].filter((box) => box.scrollWidth > box.clientWidth).length"
CUT = """[...document.querySelectorAll('.chart svg')].flatMap((svg) => {
  const frame = svg.getBoundingClientRect();
  const cut = (box) => box.left < frame.left - 1 || box.right > frame.right + 1 || box.top < frame.top - 1;
  return [...svg.querySelectorAll('text')].filter((text) => cut(text.getBoundingClientRect()));
}).map((text) => text.textContent)"""


@pytest.mark.parametrize("width", [1440, 390])
def test_tables_and_charts_fit_the_page(run, tmp_path, chromium, width):
    tree = run_tree(run)
    path = tmp_path / "report.html"
    save(path, run_document(tree).page(run_plots(tree)))
    with chromium.tab(path.as_uri(), width=width, ready=LOADED) as tab:
        assert not tab.value(WIDE)
        assert tab.value(CUT) == []
        assert width < 1000 or tab.value(SCROLLED) == 0
        cells = "[...document.querySelectorAll('td:first-child')]"
        (line_px,) = tab.value(f"[...new Set({cells}.slice(0, 6).map((cell) => cell.clientHeight))]")
        assert line_px < 40, "the names of the stages are whole"


def test_a_line_of_one_point_has_a_mark_and_a_name_is_escaped():
    def draw(axes):
        axes.plot([10.0], [80.0], color="#123456", label="<b>car")

    text = svg(Plot("", "", draw))
    assert re.search(r'<use [^>]*style="fill: #123456', text)
    assert "<b>" not in text
    assert "&lt;b&gt;car" in text


def test_charts_with_one_top_have_one_scale():
    def limits(height, top):
        energy = {"segmentation": np.full(3, height)}
        return drawn(stage_energy("", energy, np.arange(3.0), "", top)).get_ylim()

    assert limits(1.0, 9.0) == limits(9.0, 9.0)
    assert limits(1.0, 0.0) != limits(9.0, 0.0)
    drawn(stage_energy("", {}, np.arange(0.0), "", 5.0))


def test_a_quantity_without_a_value_has_no_kind():
    tiles = [("known", Quantity(1.0, "J"), ""), ("unknown", Quantity(None), "")]
    text = html(Page("", "", [Section(tiles=tiles)]))
    assert re.findall(r"<b>(.*?)\s*</b>", text, re.S) == ["1.00 J <em>(measured)</em>", "unavailable"]


def test_the_extra_that_a_page_needs_is_named(tmp_path, monkeypatch):
    monkeypatch.delitem(sys.modules, "modt_profiling.reporting.html_page", raising=False)
    monkeypatch.setitem(sys.modules, "jinja2", None)
    with pytest.raises(MisuseError, match=re.escape("needs jinja2; pip install '.[view]'")):
        save(tmp_path / "page.html", Page("", "", []))


def test_how_many_are_as_late_or_later(tmp_path):
    late = Deadlines(0.1)
    punctual = Deadlines(0.1)
    for ms in (0.2, 0.2, 3.0, 40.0):
        late.lateness_ns.add(round(1e6 * ms))
    found = late.late_or_later()
    none = punctual.late_or_later()
    assert found["ms"] == pytest.approx([0.2, 3.0, 40.0], rel=0.03)
    assert found["frames"] == [4, 2, 1]
    (tmp_path / SUMMARY).write_text(json.dumps({"lateness": found}))
    (plot,) = lateness_plots(tmp_path)
    (line,) = drawn(plot).lines
    assert (plot.title, line.get_ydata().tolist()) == ("Lateness", [4, 2, 1])
    (tmp_path / SUMMARY).write_text(json.dumps({"lateness": none}))
    assert lateness_plots(tmp_path) == []
