"""Lines of frames to files and to standard output."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from modt.schemes import open_sink
from modt.sinks.background import Background
from modt.sinks.frame_lines import Descriptor
from modt.sinks.tracks import frame_line
from tests.cli.commands import environment
from tests.results import CAR, result
from tests.sinks.test_background import settled

ROOT = Path(__file__).resolve().parents[2]
FRAMES = [result(k, [5, 4], {0: 1, 1: 2}, {1: CAR}) for k in range(5)]


@pytest.mark.parametrize("rest", ["", '{"schema":"mo'])
@pytest.mark.parametrize("whole", [FRAMES[:2], []])
def test_a_file_is_continued_and_what_a_killed_run_left_of_a_line_is_cut_off(tmp_path, whole, rest):
    (tmp_path / "lines.jsonl").write_text("".join(map(frame_line, whole)) + rest)
    sink = open_sink(f"file://{tmp_path}/lines.jsonl")
    sink.write(FRAMES[2])
    sink.close()
    assert (tmp_path / "lines.jsonl").read_text() == "".join(map(frame_line, [*whole, FRAMES[2]]))


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
