"""Lines of frames to files and pipes."""

import os

import pytest

from modt.schemes import open_sink
from modt.sinks.background import Background
from modt.sinks.frame_lines import Descriptor
from modt.sinks.tracks import frame_line
from tests.results import CAR, result
from tests.sinks.test_background import settled

FRAMES = [result(k, [5, 4], {0: 1, 1: 2}, {1: CAR}) for k in range(5)]


@pytest.mark.parametrize("rest", ["", '{"schema":"mo'])
@pytest.mark.parametrize("whole", [FRAMES[:2], []])
def test_a_file_is_continued_without_the_broken_line_of_a_killed_run(tmp_path, whole, rest):
    (tmp_path / "lines.jsonl").write_text("".join(map(frame_line, whole)) + rest)
    sink = open_sink(f"file://{tmp_path}/lines.jsonl")
    sink.write(FRAMES[2])
    sink.close()
    assert (tmp_path / "lines.jsonl").read_text() == "".join(map(frame_line, [*whole, FRAMES[2]]))


def test_a_reader_that_leaves_is_counted_and_ends_nothing(caplog):
    reader, writer = os.pipe()
    sink = Background("pipe", Descriptor(writer), 3, encode=frame_line, retry_s=0.0)
    os.dup2(writer, reader)  # the reading end is gone, its number is not
    for k in range(2):
        sink.write(FRAMES[k])
        assert settled(sink, failed=k + 1)
    sink.close()
    for end in (reader, writer):
        os.close(end)
    assert "Broken pipe" in str(sink.health()["state"])
    assert len(caplog.records) == 1
