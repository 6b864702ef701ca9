"""The paper's association."""

import numpy as np
import pytest

from modt.config import PaperAssociationConfig
from modt.observations import observe
from modt.tracking.paper_association import PaperAssociation
from tests.tracking.tracking_scenes import EYE, box, frame_of, tracks_at


def pair(before, after, points=60):
    """A track at one box, and the observation of another."""
    return tracks_at([before]), observe(frame_of([after], points=points)[1], EYE)


@pytest.mark.parametrize(
    ("after", "points", "expected"),
    [
        (box(10, 0), 60, 0.0),
        (box(12, 0), 60, 2.0 * (1 - 2 / 6)),
        (box(10, 0), 90, 0.01 * 30),
        (box(10, 0, l=5.0), 60, 2.0 * (1 - 4 / 5) + 0.1 * 1.0),
    ],
)
def test_the_cost_penalises_each_difference(after, points, expected):
    tracks, observations = pair(box(10, 0), after, points)
    zero = np.array([0])
    cost = PaperAssociation(PaperAssociationConfig()).cost(tracks, observations, zero, zero)
    np.testing.assert_allclose(cost, expected, atol=1e-9)


def test_pairs_above_the_threshold_are_not_matched():
    match = PaperAssociation(PaperAssociationConfig()).match
    assert len(match(*pair(box(10, 0), box(11, 0))).rows) == 1
    assert len(match(*pair(box(10, 0), box(12, 0))).rows) == 0
    lenient = PaperAssociation(PaperAssociationConfig(t_da=2.0))
    assert len(lenient.match(*pair(box(10, 0), box(12, 0))).rows) == 1


def test_the_last_box_is_compared_where_the_filter_expects_it():
    tracks, observations = pair(box(10, 0), box(12, 0))
    tracks.x[0, 0] += 2.0
    matches = PaperAssociation(PaperAssociationConfig()).match(tracks, observations)
    assert matches.rows.tolist() == [0]
    np.testing.assert_allclose(matches.position, observations.centroid)
    np.testing.assert_allclose(matches.covariance[0], 0.3**2 * np.eye(2))


def test_a_weight_of_overlap_below_the_threshold_matches_what_is_apart():
    config = PaperAssociationConfig(alpha=0.5)
    assert len(PaperAssociation(config).match(*pair(box(10, 0), box(30, 0))).rows) == 1


def test_as_printed_a_difference_makes_a_match_cheaper():
    tracks, observations = pair(box(10, 0), box(10, 0, l=5.0), 90)
    zero = np.array([0])
    printed = PaperAssociation(PaperAssociationConfig(differences="subtracted"))
    expected = 2.0 * (1 - 4 / 5) - 0.01 * 30 - 0.1 * 1.0
    np.testing.assert_allclose(printed.cost(tracks, observations, zero, zero), expected, atol=1e-9)
    far, at = pair(box(10, 0), box(30, 0), 200)
    assert len(printed.match(far, at).rows) == 1


@pytest.mark.parametrize(("gate", "row"), [("before", 0), ("after", 1)])
def test_pairs_above_the_threshold_compete_where_the_gate_comes_after(gate, row):
    """Crosswise both tracks cost least together, one pair of them too much."""
    tracks, observations = tracks_at([box(10, 0)] * 2), observe(frame_of([box(10, 0)] * 2)[1], EYE)
    association = PaperAssociation(PaperAssociationConfig(gate=gate, t_da=0.3))
    association.cost = lambda *_: np.array([0.1, 0.4, 0.2, 0.9])
    assert association.match(tracks, observations).rows.tolist() == [row]
