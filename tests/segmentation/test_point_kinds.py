"""Every point of a sweep has one kind, whatever the sweep."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modt.app import assembly
from modt.config import SegmentationConfig, SensorConfig
from modt.geometry import FieldOfView
from modt.profile import load
from modt.segmentation.segmenter import Segmenter
from modt.types import NONE, Frame, PointKind
from tests.results import result as made_up_result
from tests.segmentation import scans
from tests.segmentation.test_native_kernels import make_hostile, street
from tests.segmentation.test_segmenter import AHEAD, PERSON

SENSOR = SensorConfig(min_range_m=1.0)


def fog(rng, n):
    """(n, 4) points that scatter around the sensor."""
    direction = rng.normal(0, 1, (n, 3))
    range_m = rng.exponential(3.0, n)
    direction *= (range_m / np.linalg.norm(direction, axis=1))[:, None]
    return np.column_stack([direction, rng.random(n)]).astype(np.float32)


def room(rng, n):
    """(n, 4) points on the floor, the walls and the ceiling of a room."""
    points = rng.uniform(-1, 1, (n, 4)) * [4.0, 3.0, 1.2, 1.0]
    face = rng.integers(0, 3, n)
    rows = np.arange(n)
    points[rows, face] = np.copysign([4.0, 3.0, 1.2], points[rows][:, :3])[rows, face]
    return points.astype(np.float32)


SCENES = {"street": lambda rng, n: street(int(rng.integers(1000)), n), "fog": fog, "room": room}


@pytest.mark.parametrize("fov", [None, AHEAD], ids=["all round", "ahead"])
@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(0, 1500),
    scene=st.sampled_from(sorted(SCENES)),
    hostile=st.just(0.0) | st.floats(0, 1),
)
@settings(max_examples=80, deadline=None)
def test_every_point_has_one_kind(fov, seed, n, scene, hostile):
    rng = np.random.default_rng(seed)
    points = SCENES[scene](rng, n)
    make_hostile(points, rng, hostile)
    with np.errstate(all="ignore"):
        proposals = Segmenter(SegmentationConfig(), SENSOR, fov or FieldOfView()).segment(points)
    is_member = proposals.label(n) != NONE
    foot, beside = proposals.feet if proposals.feet is not None else np.zeros((2, 0), np.int64)
    assert sorted(foot.tolist()) == np.flatnonzero(proposals.kind == PointKind.FOOT).tolist()
    assert np.isin(proposals.kind[beside], (PointKind.MEMBER, PointKind.STRUCTURE)).all()
    assert proposals.kind.shape == (n,)
    assert ((proposals.kind == PointKind.MEMBER) == is_member).all()
    assert set(proposals.kind.tolist()) <= {kind.value for kind in PointKind}
    assert len(np.unique(proposals.members)) == len(proposals.members)


def test_kinds_of_a_scene_with_one_thing_each():
    """A person, a kerb, a pole of three returns, a long wall, a plate above, and points too near and too far."""
    boxes = [
        (8.0, 0.0, *PERSON),
        (9.0, 6.0, 0.3, 6.0, 0.0, 0.33),
        (14.0, 0.0, 0.2, 30.0, 0.0, 2.4),
        (6.0, -3.0, 1.0, 1.0, 2.7, 3.0),
    ]
    points, on = scans.scan(boxes, elevation=np.deg2rad(np.linspace(-24, 40, 96)))
    extra = np.array(
        [(0.5, 0, 0, 0), (200.0, 0, 0, 0), (0, 0, 0, 0), (-7.0, 0, -0.9, 0), (-7.0, 0, -0.8, 0)], np.float32
    )
    points = np.concatenate([points, extra])
    proposals = Segmenter(SegmentationConfig(), SENSOR, FieldOfView()).segment(points)
    kind = proposals.kind
    clear = points[:, 2] > -1.73 + 0.26
    expected = [PointKind.GROUND, PointKind.MEMBER, PointKind.LOW, PointKind.STRUCTURE, PointKind.OVERHEAD]
    for thing, wanted in enumerate(expected):
        of_thing = kind[: len(on)][(on == thing) & (clear[: len(on)] | (thing == 0))]
        assert len(of_thing) >= 4
        assert (of_thing == wanted).mean() > 0.7, wanted
    assert kind[-5:].tolist() == [PointKind.OUT_OF_RANGE] * 3 + [PointKind.SPARSE] * 2


def test_labels_name_the_track_of_each_point_else_its_kind():
    points, on = scans.scan([(8.0, 0.0, *PERSON)])
    mode = assembly.MODES["accurate"]
    config = load()
    pipeline = assembly.pipeline(mode, config, FieldOfView())
    result = pipeline.step(Frame(0, 0.0, points, np.eye(4)), mode.budget(config))
    (of_person,) = set(result.labels[(on == 1) & (points[:, 2] > -1.4)].tolist())
    assert of_person == result.tracks.id[0]
    assert result.obstacles().tolist() == np.flatnonzero(result.labels == of_person).tolist()
    left_out = result.left_out()
    assert left_out[PointKind.GROUND] == (result.labels == PointKind.GROUND).sum() > 1000
    n_feet = np.count_nonzero(result.proposals.kind == PointKind.FOOT)
    assert sum(left_out.values()) + len(result.proposals.members) + n_feet == len(points)


def test_proposals_of_a_record_have_no_labels():
    with pytest.raises(ValueError, match="kinds of the points"):
        _ = made_up_result(0, [5], {0: 1}).labels
