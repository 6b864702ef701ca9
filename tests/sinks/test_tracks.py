"""tracks.jsonl."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from modt.class_sizes import unknown_near
from modt.classes import CLASS_NAMES
from modt.geometry import inverse, rotation_zyx, se3, transform_boxes
from modt.sinks.records import line
from modt.sinks.tracks import BOX_KEYS, SCHEMA, UNKNOWN_NEAR, WORLD_KEYS, frame_line
from modt.types import MOTION_NAMES, NONE, Cut
from modt_evaluation.recorded_result import recorded_pose
from tests.results import PEDESTRIAN, frame_record, result


def test_a_record_counts_what_was_done_in_its_frame():
    record = frame_record(result(3, [7, 5], {0: 11, 1: 12}, lost=(9,), classified=2))
    del record["tracks"], record["T_world_sensor"]
    counts = {"proposals": 2, "classifications": 2, "deferred": 0, "classified": [0, 1]}
    good = {"level": "good", "since_s": 0.0, "reasons": [], "visibility_m": None}
    assert record == {"schema": SCHEMA, "run": None, "frame": 3, "stamp_s": 0.3, "trust": good} | counts


@pytest.mark.parametrize(
    ("size", "cut", "posteriors", "said"),
    [
        ((0.5, 0.4, 0.5), Cut.TOP, {}, UNKNOWN_NEAR),
        ((0.5, 0.4, 0.5), Cut.BOTTOM, {}, None),
        ((0.5, 0.4, 0.8), Cut.TOP, {}, UNKNOWN_NEAR),
        ((0.5, 0.4, 0.9), Cut.TOP, {}, None),  # more than half of a person is in view
        ((1.2, 0.4, 0.5), Cut.TOP, {}, None),  # longer than a person
        ((0.5, 0.4, 0.5), Cut.TOP, {11: PEDESTRIAN}, None),
    ],
)
def test_a_possible_person_too_near_to_be_recognised_is_reported_as_uncertain(size, cut, posteriors, said):
    r = result(3, [7, 5], {0: 11}, posteriors, lost=(9,))
    r.proposals.box[0, 3:6] = size
    r.proposals.cut[0] = cut
    assert [track["uncertain"] for track in frame_record(r)["tracks"]] == [said, None]
    assert unknown_near(r).tolist() == [said is not None, False]


def test_the_pose_of_the_sensor_is_recorded_and_read_back():
    T = se3(rotation_zyx(0.01, -0.02, 2.5), np.array([123.4567891, -1e4, 0.5]))
    record = frame_record(result(3, [5], {0: 1}, T_world_sensor=T))
    assert record["T_world_sensor"][3::4] == [123.456789, -1e4, 0.5]
    np.testing.assert_allclose(recorded_pose(record), T, rtol=0, atol=5.1e-7)


NUMBERS = st.floats(-200, 200) | st.floats(-1e7, 1e7) | st.sampled_from([0.0, -0.0, 0.0005, 1e8, -1e17, 5e-324])
LIKELIHOODS = st.one_of(st.floats(0, 1), st.sampled_from([0.0, 1.0, 1e-6, 1.2e-5, 1 + 1e-9, -1e-9]))
COUNTS = st.integers(0, 10**12)


@st.composite
def results(draw):
    """Frames of few or no tracks and proposals, with any numbers."""
    tracked = draw(st.integers(0, 4))
    lost = draw(st.integers(0, 3))
    r = result(draw(COUNTS), [3] * tracked, {p: 7 + p for p in range(tracked)}, lost=tuple(range(90, 90 + lost)))
    t = r.tracks
    for column in (t.points, t.age, t.missed):
        column[:] = draw(arrays(np.int64, column.shape, elements=COUNTS))
    for column, elements in (
        (t.x, NUMBERS),
        (t.size_m, NUMBERS),
        (r.proposals.box, NUMBERS),
        (t.whole_box, NUMBERS),
        (t.velocity, NUMBERS),
        (t.velocity_covariance, NUMBERS),
        (t.moving_probability, LIKELIHOODS),
        (t.posterior, LIKELIHOODS),
    ):
        column[:] = draw(arrays(np.float64, column.shape, elements=elements))
    t.final[:] = draw(arrays(np.bool_, len(t)))
    t.heading_known[:] = draw(arrays(np.bool_, len(t)))
    t.motion[:] = draw(arrays(np.int64, len(t), elements=st.integers(0, 2)))
    t.object_class[:] = draw(arrays(np.int64, len(t), elements=st.integers(0, 3)))
    r.proposals.cut[:] = draw(arrays(np.int64, tracked, elements=st.sampled_from([0, Cut.TOP])))
    return r


def question(t, k):
    """The class with a question mark where an object has a posterior below one half."""
    class_ = t.object_class[k]
    return f"{CLASS_NAMES[class_]}?" if class_ > 0 and t.posterior[k, class_] < 0.5 else None


def tracks_one_by_one(r):
    """The tracks of a record, slowly."""
    for k in range(len(r.tracks)):
        t = r.tracks
        proposal = int(r.tracks.proposal[k])
        seen = None if proposal == NONE else np.round(r.proposals.box[proposal], 3).tolist()
        box = np.round(transform_boxes(inverse(r.T_world_sensor), t.whole_box[k : k + 1])[0], 3).tolist()
        (xx, xy), (_, yy) = np.round(t.velocity_covariance[k], 3).tolist()
        yield {
            "id": int(t.id[k]),
            "state": r.state_names[t.state[k]],
            "class": CLASS_NAMES[t.object_class[k]],
            "posterior": np.round(t.posterior[k], 6).tolist(),
            "witness": np.round(t.motion_evidence[k], 3).tolist(),
            "viewed": bool(t.viewed[k]),
            "final": bool(t.final[k]),
            "uncertain": UNKNOWN_NEAR if unknown_near(r)[k] else question(t, k),
            "proposal": None if proposal == NONE else proposal,
            "points": int(t.points[k]),
            "age": int(t.age[k]),
            "missed": int(t.missed[k]),
            "box": None if proposal == NONE else dict(zip(BOX_KEYS, box, strict=True)),
            "heading_known": bool(t.heading_known[k]),
            "seen": seen and dict(zip(BOX_KEYS, seen, strict=True)),
            "size": np.round(t.size_m[k], 3).tolist(),
            "world": dict(zip(WORLD_KEYS, np.round(t.x[k], 3).tolist(), strict=True)),
            "motion": MOTION_NAMES[t.motion[k]],
            "moving": float(np.round(t.moving_probability[k], 3)),
            "velocity": np.round(t.velocity[k], 3).tolist(),
            "velocity_covariance": [xx, xy, yy],
        }


@settings(max_examples=60)
@given(results())
def test_a_line_equals_the_json_of_its_tracks_one_by_one(r):
    record = frame_record(r)
    assert frame_line(r) == line(record | {"tracks": list(tracks_one_by_one(r))})


@pytest.mark.parametrize("column", ["x", "posterior"])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_numbers_that_are_not_finite_are_refused(column, bad):
    r = result(0, [3], {0: 1})
    getattr(r.tracks, column)[0, 1] = bad
    with pytest.raises(ValueError, match="JSON"):
        frame_line(r)
