import json

import pytest

from modt.app.deadlines import Timing
from modt.sinks.run_directory import SUMMARY
from modt_desk.reporting.run_report import lateness_plots


def test_how_many_are_as_late_or_later(tmp_path):
    timing = Timing()
    for ms in (0.2, 0.2, 3.0, 40.0):
        timing.add(0.0, 1e-3 * ms, 0.05, 0.1)
    found = timing.late_or_later()
    assert found["ms"] == pytest.approx([0.2, 3.0, 40.0], rel=0.03)
    assert found["frames"] == [4, 2, 1]
    (tmp_path / SUMMARY).write_text(json.dumps({"lateness": found}))
    ((title, svg, _),) = lateness_plots(tmp_path)
    assert (title, svg.count("<polyline")) == ("Lateness", 1)


@pytest.mark.parametrize("summary", [None, {}, {"lateness": Timing().late_or_later()}])
def test_no_lateness_is_no_plot(summary, tmp_path):
    if summary is not None:
        (tmp_path / SUMMARY).write_text(json.dumps(summary))
    assert lateness_plots(tmp_path) == []
