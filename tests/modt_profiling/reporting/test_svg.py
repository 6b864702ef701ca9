"""Charts can be read: marks of single points, one scale for what is compared, labels apart."""

import re

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from modt_profiling.reporting import svg


def trace(x, y, **more):
    return svg.Trace("a", np.array(x, float), np.array(y, float), **more)


def test_a_class_of_one_band_of_range_has_a_mark_of_its_colour():
    drawn = svg.lines([trace([10], [80], colour="#123456"), trace([10, 30], [70, 60])], "range [m]", "%")
    assert re.search(r'<circle [^>]*style="fill:#123456"', drawn)
    assert drawn.count("<circle") == drawn.count("<polyline") == 1


def test_charts_with_one_top_have_one_scale():
    frames = np.arange(3.0)

    def ticks(height, top):
        drawn = svg.areas(frames, {"a": np.full(3, height)}, "frame", "mJ", top)
        return re.findall(r'class="end"[^>]*>([^<]*)<', drawn)

    assert ticks(1.0, 9.0) == ticks(9.0, 9.0) == ticks(9.0, 0.0)
    assert ticks(1.0, 0.0) != ticks(9.0, 0.0)
    assert svg.areas(frames[:0], {}, "frame", "mJ", 5.0).startswith("<svg")


@given(st.floats(1e-3, 1e3), st.floats(2.0, 1e5), st.booleans())
def test_labels_of_an_axis_stand_apart(low, factor, log):
    drawn = svg.lines([trace([low, low * factor], [1, 2])], "x", "y", log=log)
    labels = re.findall(r'class="mid" x="([^"]+)" y="202">([^<]*)<', drawn)
    middle, width = np.array([float(x) for x, _ in labels]), np.array([6.0 * len(text) for _, text in labels])
    assert len(labels) >= 1
    assert (np.diff(middle) > (width[1:] + width[:-1]) / 2).all()
