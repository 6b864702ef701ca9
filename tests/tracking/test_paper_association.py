"""The paper's association."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.observations import observe
from modt.tracking import paper_association
from modt.tracking.paper_association import PaperAssociation
from tests.tracking.tracking_scenes import EYE, box, frame_of, tracks_at


def pair(before, after, points=60):
    """A track at one box, and the observation of another; their centroids are the centres of the boxes."""
    tracks, observations = tracks_at([before]), observe(frame_of([after], points=points)[1], EYE)
    tracks.x[:, :2] = tracks.box[:, :2]
    return tracks, replace(observations, centroid=observations.box[:, :2])


def cost(before, after, points=60):
    """Cost of such a pair."""
    zero = np.array([0])
    return PaperAssociation().cost(*pair(before, after, points), zero, zero)[0]


@pytest.mark.parametrize(
    ("after", "points", "expected"),
    [
        (box(10, 0), 60, -0.01 - 0.3),
        (box(12, 0), 60, 2.0 * (1 - 2 / 6) - 0.01 - 0.3),
        (box(10, 0), 90, -0.01 * 2 / 3 - 0.3),
        (box(10, 0, l=5.0), 60, 2.0 * (1 - 4 / 5) - 0.01 - 0.1 * (2 + 4 / 5)),
    ],
)
def test_likenesses_are_rewarded(after, points, expected):
    assert cost(box(10, 0), after, points) == pytest.approx(expected, abs=1e-9)


@given(st.floats(0.0, 3.0), st.floats(0.3, 5.0), st.integers(20, 300))
def test_no_pair_costs_less_than_one_of_equals(shift, length, points):
    assert cost(box(10, 0), box(10 + shift, 0, l=length), points) >= cost(box(10, 0), box(10, 0)) - 1e-9


@pytest.mark.parametrize(("x", "t_da", "n"), [(11, 0.95, 1), (12, 0.95, 0), (12, 2.0, 1)])
def test_pairs_above_the_threshold_are_not_matched(x, t_da, n, monkeypatch):
    monkeypatch.setattr(paper_association, "T_DA", t_da)
    assert len(PaperAssociation().match(*pair(box(10, 0), box(x, 0))).rows) == n


def test_the_last_box_is_compared_about_its_centroid_where_the_filter_expects_it():
    """Boxes of one length at one centroid overlap wholly, wherever their middles are."""
    tracks, observations = pair(box(10, 0), box(12, 0))
    tracks.x[0, 0] += 2.0
    tracks.box[0, :2] += 3.0
    matches = PaperAssociation().match(tracks, observations)
    assert matches.rows.tolist() == [0]
    np.testing.assert_allclose(matches.position, observations.centroid)


def test_pairs_above_the_threshold_compete(monkeypatch):
    """Crosswise both tracks cost least together, one pair of them too much."""
    tracks, observations = tracks_at([box(10, 0)] * 2), observe(frame_of([box(10, 0)] * 2)[1], EYE)
    monkeypatch.setattr(paper_association, "T_DA", 0.3)
    association = PaperAssociation()
    association.cost = lambda *_: np.array([0.1, 0.4, 0.2, 0.9])
    assert association.match(tracks, observations).rows.tolist() == [1]
