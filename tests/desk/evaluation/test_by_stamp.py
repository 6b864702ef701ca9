"""The truth of a run whose frames are numbered as they arrived."""

from pathlib import Path

import numpy as np
import pytest

from modt.sources.scan_file import ScanReference, ScanStream
from modt.sources.stream import StreamInfo
from modt_desk.evaluation.rules import KITTI_RULES
from modt_desk.evaluation.run_record import FramesByNumber
from modt_desk.evaluation.truth import KITTI_TYPES, FrameTruth, Truth, by_stamp
from modt_desk.simulation.synthetic_stream import SyntheticStream

INFO = StreamInfo("drive", "folder", 0, None, 0.1, None, has_poses=False)


def truth(stamps_s, labelled):
    scans = [ScanReference(k, Path(f"{k}.bin"), s, None) for k, s in enumerate(stamps_s)]
    frames = {k: FrameTruth.of(KITTI_TYPES, [k], ["Car"], np.zeros((1, 7))) for k in labelled}
    return Truth(frames, ScanStream(INFO, scans), KITTI_RULES)


@pytest.mark.parametrize("origin_s", [0.0, 1.7e9])
def test_frames_have_the_labels_and_the_scan_of_their_stamp(origin_s):
    found = by_stamp(
        truth([5.0, 5.1, 5.2, 5.3], [0, 1, 3]), {7: origin_s + 5.01, 8: origin_s + 5.2, 20: origin_s + 9}
    )
    assert {number: labels.id.tolist() for number, labels in found.frames.items()} == {7: [0]}
    assert [(scan.index, scan.path.name) for scan in found.scans.scans] == [(7, "0.bin"), (8, "2.bin")]
    bare = Truth({}, None, KITTI_RULES)
    assert by_stamp(bare, {0: origin_s}) is bare, "without scans there are no stamps"


def test_frames_are_found_and_those_between_passed_over():
    frames = FramesByNumber(SyntheticStream(seconds=0.6, sensor="vlp-16").between(1, 5))
    found = [frames.get(number) for number in (0, 2, 2, 4, 5, 9)]
    assert [None if frame is None else frame.index for frame in found] == [None, 2, 2, 4, None, None]
