"""Frames of a stream by their numbers."""

from modt_desk.evaluation.run_record import FramesByNumber
from modt_desk.simulation.synthetic_stream import SyntheticStream


def test_frames_are_found_and_those_between_passed_over():
    frames = FramesByNumber(SyntheticStream(seconds=0.6, sensor="vlp-16").between(1, 5))
    found = [frames.get(number) for number in (0, 2, 2, 4, 5, 9)]
    assert [None if frame is None else frame.index for frame in found] == [None, 2, 2, 4, None, None]
