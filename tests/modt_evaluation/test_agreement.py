"""Drives through the pipeline, judged twice: by the package and by the definitions in plain loops."""

import dataclasses

import pytest

from modt import profile
from modt.app import assembly
from modt.geometry import FieldOfView
from modt.sources.recognise import open_stream
from modt_evaluation.frame import JudgedFrame
from modt_evaluation.rules import KITTI_RULES
from modt_evaluation.truth import KITTI_TYPES, FrameTruth
from modt_evaluation.truth_files import open_truth
from modt_simulation.synthetic_stream import SyntheticStream
from tests.modt_evaluation.reference import life, precision_of_ranking, recall
from tests.modt_evaluation.scenes import score

ALL_COUNTS = dataclasses.replace(KITTI_RULES, ignored=frozenset({"parked"}))


def judged(frames, truth_of, fov=None, name="hdl-64e"):
    fov = fov or FieldOfView()
    mode = assembly.MODES["accurate"]
    settings = profile.load(name)
    pipeline = assembly.pipeline(mode, settings, fov)
    for frame in frames:
        truth = truth_of(frame.index)
        yield JudgedFrame.of_result(pipeline.step(frame, mode.budget(settings)), truth, fov)


def agree(frames):
    found = score(frames, ALL_COUNTS)
    segmentation = found.ranges["all"].segmentation
    for name, (expected, n) in recall(frames).items():
        assert (segmentation[name].recall, segmentation[name].objects) == (pytest.approx(expected), n)
    for name, (expected, n) in precision_of_ranking(frames).items():
        own = found.ranges["all"].classification[name]
        assert own.objects == n
        assert (own.average_precision or 0) == pytest.approx(expected, abs=1e-3)  # ties in another order
    tracks = found.tracks["all"]
    expected = life(frames)
    assert (tracks.life_as_seen.life, tracks.life.frames) == (pytest.approx(expected[0]), expected[1])
    assert (tracks.discontinuities, tracks.mis_associations) == expected[2:]


@pytest.mark.slow
def test_a_synthetic_drive():
    stream = SyntheticStream("street", "vlp-16", 1.5, seed=3)
    truths = {}

    def frames():
        for frame, truth in stream.sweeps():
            types = [kind.name for kind in truth.kinds]
            truths[frame.index] = FrameTruth.of(KITTI_TYPES, truth.bodies, types, truth.boxes)
            yield frame

    found = list(judged(frames(), lambda index: truths[index], name="vlp-16"))
    assert sum(recall(found)[name][1] for name in recall(found)) > 20
    agree(found)


@pytest.mark.kitti
@pytest.mark.parametrize("camera", [False, True])
def test_a_part_of_drive_0005(drive_0005, camera):
    truth = open_truth(drive_0005)
    stream = open_stream(drive_0005).between(112, 142)
    fov = FieldOfView.of_camera(stream.info.camera) if camera else None
    frames = list(judged(stream, lambda index: truth.frames[index], fov))
    assert len(frames) == 30
    agree(frames)
