"""Sweeps of two sensors are joined by their times."""

from collections import Counter

import numpy as np
import pytest

from modt.sources.joining import JointStream, SweepJoiner
from modt.sources.stream import Faults, Reading, StreamInfo
from modt.types import Frame
from tests.robots import CORNERS, FRONT, REAR

PERIOD_S = 0.1


def sweep(stamp_s, index=0, x=1.0, **more):
    return Frame(index, stamp_s, np.array([[x, 0, 0, 0.5], [0, 0, 0, 0]], np.float32), **more)


class Recorded:
    """A stream of sweeps at given stamps, which count from `began_s`."""

    def __init__(self, stamps, began_s=0.0, **more):
        self.info = StreamInfo("drive", "test", period_s=PERIOD_S, began_s=began_s)
        self.faults = Faults()
        self.reading = Reading(messages=len(stamps), sweeps=len(stamps))
        self.stamps = stamps
        self.more = more

    def __iter__(self):
        return (sweep(stamp_s, k, **self.more) for k, stamp_s in enumerate(self.stamps))

    def between(self, first, last):
        return Recorded(self.stamps[first:last], self.info.began_s, **self.more)


def stamps(n, phase_s=0.0, jitter_s=0.0):
    jitter = np.random.default_rng(0).uniform(-jitter_s, jitter_s, n)
    return (PERIOD_S * np.arange(n) + phase_s + jitter).tolist()


def joined(front, rear):
    stream = JointStream(CORNERS, [Recorded(front), Recorded(rear)])
    present = [tuple(each is not None for each in frame.sweeps) for frame in stream]
    return stream, present


@pytest.mark.parametrize("phase_s", [0.0, 0.02, 0.049, 0.05, 0.08])
def test_free_running_sensors_give_one_frame_a_period(phase_s):
    stream, present = joined(stamps(20, jitter_s=0.003), stamps(20, phase_s, jitter_s=0.003))
    assert Counter(present)[True, True] >= 19
    assert len(present) <= 21
    assert stream.reading.alone.total() == len(present) - Counter(present)[True, True]


def test_a_sensor_that_is_silent_for_a_while_leaves_the_other_alone():
    stream, present = joined(stamps(20), [s for s in stamps(20) if not 0.45 < s < 1.05])
    assert present == [(True, True)] * 5 + [(True, False)] * 6 + [(True, True)] * 9
    assert stream.reading.alone == {"front": 6}
    assert stream.reading.sweeps == 34


def test_a_faster_sensor_has_frames_of_its_own_between():
    fast = Recorded([0.05 * k for k in range(20)])
    fast.info = StreamInfo("drive", "test", period_s=0.05)
    present = [frame.sweeps[0] is not None for frame in JointStream(CORNERS, [Recorded(stamps(10, 0.01)), fast])]
    assert present == [True, False] * 10


def test_stamps_of_frames_never_decrease_and_are_those_of_the_first_sensor():
    stream, _ = joined(stamps(9), stamps(9, 0.03))
    times = [frame.stamp_s for frame in stream]
    assert times == pytest.approx(stamps(9))
    assert [frame.index for frame in stream] == [*range(9)]


def test_stamps_that_count_from_different_times_are_brought_together():
    stream = JointStream(CORNERS, [Recorded(stamps(5), 100.0), Recorded(stamps(5), 100.03)])
    assert [frame.sweeps[1].stamp_s - frame.stamp_s for frame in stream] == pytest.approx([0.03] * 5)


def test_points_and_pose_are_those_of_the_robot():
    pose = np.eye(4)
    pose[:3, 3] = 7.0, 0.0, 0.6
    stream = JointStream(CORNERS, [Recorded([0.0], T_world_sensor=pose), Recorded([0.0])])
    (frame,) = stream
    ahead_of_front, no_return, ahead_of_rear, _ = frame.points
    cos = np.cos(np.pi / 4)
    assert ahead_of_front == pytest.approx([0.5 + cos, 0.35 + cos, 0.6, 0.5])
    assert ahead_of_rear == pytest.approx([-0.5 - cos, -0.35 - cos, 0.6, 0.5])
    assert no_return.tolist() == [0, 0, 0, 0]
    assert frame.T_world_sensor @ FRONT.T_robot_sensor == pytest.approx(pose)


def test_a_part_has_the_numbers_of_the_whole():
    stream, _ = joined(stamps(9), stamps(9, 0.03))
    assert [frame.index for frame in stream.between(3, 6)] == [3, 4, 5]
    assert [frame.index for frame in stream.between(3, 6).between(4, None)] == [4, 5]


def test_clocks_that_have_nothing_in_common_are_warned_of(caplog):
    _, present = joined(stamps(5), stamps(5, 50.0))
    assert present == [(True, False)] * 5 + [(False, True)] * 5
    assert "the clocks of the sensors differ" in caplog.text


def test_faults_of_all_sensors_are_those_of_the_stream():
    streams = [Recorded(stamps(2)), Recorded(stamps(2))]
    joint = JointStream(CORNERS, streams)
    streams[1].faults.report(1, "file", "broken", skipped=True)
    assert joint.faults.skipped == 1
    assert joint.between(0, 1).faults.count == 0


def test_an_absent_sensor_is_not_waited_for_until_it_is_back():
    joiner = SweepJoiner(2, 0.06)
    assert [*joiner.add(0, sweep(0.0))] == []
    assert [*joiner.take()] == [0]
    joiner.absent.add(1)
    assert [[*sweeps] for sweeps in joiner.add(0, sweep(0.1))] == [[0]]
    assert [*joiner.add(1, sweep(0.2))] == []
    assert [[*sweeps] for sweeps in joiner.add(0, sweep(0.21))] == [[1, 0]]


def test_a_name_of_the_sensor_that_is_alone_is_counted():
    stream = JointStream((FRONT, REAR), [Recorded([]), Recorded(stamps(3))])
    assert len([*stream]) == 3
    assert stream.reading.alone == {"rear": 3}
