"""Lines of frames to files and to standard output."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from modt.schemes import open_sink
from modt.sinks.background import Background
from modt.sinks.frame_lines import Descriptor
from modt.sinks.tracks import SCHEMA, frame_line
from modt_desk.reporting.records import read_records
from tests.cli.commands import environment
from tests.results import CAR, result
from tests.sinks.test_background import settled

ROOT = Path(__file__).resolve().parents[2]
FRAMES = [result(k, [5, 4], {0: 1, 1: 2}, {1: CAR}) for k in range(5)]


def test_a_file_is_continued(tmp_path):
    for frames in (FRAMES[:2], FRAMES[2:]):
        sink = open_sink(f"file://{tmp_path}/lines.jsonl")
        for frame in frames:
            sink.write(frame)
        sink.close()
    assert (tmp_path / "lines.jsonl").read_text() == "".join(map(frame_line, FRAMES))


@pytest.mark.parametrize("whole", [FRAMES[:1], []])
def test_what_a_killed_run_left_of_a_line_is_cut_off(tmp_path, whole):
    (tmp_path / "lines.jsonl").write_text("".join(map(frame_line, whole)) + '{"schema":"mo')
    sink = open_sink(f"file://{tmp_path}/lines.jsonl")
    sink.write(FRAMES[1])
    sink.close()
    assert [record["frame"] for record in read_records(tmp_path / "lines.jsonl", SCHEMA)] == [*range(len(whole)), 1]


def test_lines_go_to_standard_output():
    script = """
from modt.schemes import open_sink
from tests.results import result
sink = open_sink("-")
for k in range(3):
    sink.write(result(k, [5], {0: 1}))
sink.close()
"""
    options = {"capture_output": True, "text": True, "env": environment(), "cwd": ROOT}
    done = subprocess.run([sys.executable, "-c", script], check=True, **options)
    assert done.stdout == "".join(frame_line(result(k, [5], {0: 1})) for k in range(3))
    assert done.stderr == ""


@pytest.fixture
def pipe():
    ends = list(os.pipe())
    yield ends
    for end in ends:
        os.close(end)


def test_a_reader_that_leaves_is_counted_and_ends_nothing(pipe, caplog):
    reader, writer = pipe
    sink = Background("pipe", Descriptor(writer), 3, encode=frame_line, retry_s=0.0)
    os.dup2(writer, reader)  # the reading end is gone, its number is not
    sink.write(FRAMES[0])
    assert settled(sink, failed=1)
    sink.write(FRAMES[1])
    assert settled(sink, failed=2)
    sink.close()
    assert "Broken pipe" in str(sink.health()["state"])
    assert len(caplog.records) == 1
