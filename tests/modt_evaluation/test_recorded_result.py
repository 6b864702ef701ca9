"""Results read back from their records."""

import numpy as np

from modt.geometry import wrap
from modt.types import NONE
from modt_evaluation.recorded_result import recorded_result
from tests.golden.replay import replay
from tests.results import CAR, frame_record, result


def test_a_recorded_frame_has_the_record_and_the_boxes_of_the_result():
    made = [*replay("accurate"), result(3, [], {}), result(4, [], {}, {7: CAR}, lost=(7,))]
    assert any((one.tracks.proposal == NONE).any() for one in made)
    for one in made:
        again = recorded_result(frame_record(one))
        assert frame_record(again) == frame_record(one)
        assert (again.frame.index, len(again.tracks)) == (one.frame.index, len(one.tracks))
        seen = one.tracks.proposal != NONE
        box = again.tracks.box[seen]
        expected = one.tracks.box[seen]
        np.testing.assert_allclose(box[:, :6], expected[:, :6], rtol=0, atol=2e-3)
        assert np.abs(wrap(box[:, 6] - expected[:, 6])).max(initial=0.0) < 1e-3
