"""Recorded frames are again the results that they were."""

import numpy as np
import pytest

from modt.geometry import wrap
from modt.types import NONE
from modt_desk.evaluation.recorded_result import recorded_result
from tests.golden.replay import replay
from tests.results import CAR, frame_record, result


@pytest.fixture(scope="module")
def results():
    """The frames of a second of street."""
    return list(replay("street-vlp-16", "accurate"))


def recorded(made):
    return recorded_result(frame_record(made))


def test_the_record_of_a_recorded_result_is_the_record(results):
    assert any((made.tracks.proposal == NONE).any() for made in results)
    for made in results:
        assert frame_record(recorded(made)) == frame_record(made)


def test_boxes_lie_in_the_world_as_they_did(results):
    for made in results:
        seen = made.tracks.proposal != NONE
        again = recorded(made).tracks.box[seen]
        np.testing.assert_allclose(again[:, :6], made.tracks.box[seen, :6], rtol=0, atol=2e-3)
        assert np.abs(wrap(again[:, 6] - made.tracks.box[seen, 6])).max() < 1e-3


def test_a_frame_without_tracks_and_one_whose_tracks_are_lost():
    for made in (result(3, [], {}), result(4, [], {}, {7: CAR}, lost=(7,))):
        again = recorded(made)
        assert (again.frame.index, len(again.tracks), len(again.proposals)) == (
            made.frame.index,
            len(made.tracks),
            0,
        )
        assert frame_record(again) == frame_record(made)
