import json

import pytest

from modt.reporting.lateness_plot import lateness_plots
from modt.reporting.log_histogram import LogHistogram
from modt.sinks.run_directory import SUMMARY


def test_how_many_are_as_late_or_later(tmp_path):
    late = LogHistogram()
    for ms in (0.2, 0.2, 3.0, 40.0):
        late.add(1e-3 * ms)
    found = late.beyond()
    beyond = dict(zip(found["ms"], found["frames"], strict=True))
    assert [beyond[ms] for ms in (min(beyond), max(beyond))] == [4, 1]
    assert min(beyond) == pytest.approx(0.2, rel=0.1)
    assert max(beyond) == pytest.approx(40.0, rel=0.1)
    assert [n for ms, n in beyond.items() if 0.3 < ms < 2.5] == [2] * sum(0.3 < ms < 2.5 for ms in beyond)
    (tmp_path / SUMMARY).write_text(json.dumps({"lateness": found}))
    ((title, svg, _),) = lateness_plots(tmp_path)
    assert (title, svg.count("<polyline")) == ("Lateness", 1)


@pytest.mark.parametrize("summary", [None, {}, {"lateness": LogHistogram().beyond()}])
def test_no_lateness_is_no_plot(summary, tmp_path):
    if summary is not None:
        (tmp_path / SUMMARY).write_text(json.dumps(summary))
    assert lateness_plots(tmp_path) == []
