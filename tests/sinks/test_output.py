"""Properties of all sinks of files."""

import errno
import threading
from unittest.mock import Mock

import pytest

from modt.errors import ModtError
from modt.sinks.output import LineFile, close_together, replace_file


def test_sinks_that_hang_are_closed_together():
    meeting = threading.Barrier(3, timeout=60.0)

    class Hanging:
        def close(self):
            meeting.wait()

    close_together([Hanging(), Hanging(), Hanging()])
    assert not meeting.broken


@pytest.mark.parametrize("left", ["a link", "half a file"])
def test_a_file_is_replaced_whatever_was_left_in_its_place(tmp_path, left):
    victim, part = tmp_path / "victim", tmp_path / ".run.yaml.part"
    victim.write_text("kept")
    part.symlink_to(victim) if left == "a link" else part.write_text("half")
    replace_file(tmp_path / "run.yaml", "new", lasting=True)
    assert victim.read_text() == "kept"
    assert (tmp_path / "run.yaml").read_text() == "new"
    assert not (tmp_path / "run.yaml").is_symlink()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.yaml", "victim"]


def test_a_line_that_fails_half_way_leaves_nothing_behind(tmp_path):
    file = LineFile[str](tmp_path / "lines")
    file.write("one\n")
    whole = file._file

    def half(data):
        whole.write(data[:2])
        raise OSError(errno.EIO, "Input/output error")

    file._file = Mock(wraps=whole, write=half)
    with pytest.raises(ModtError):
        file.write("two\n")
    file._file = whole
    file.write("three\n")
    file.close()
    assert (tmp_path / "lines").read_text() == "one\nthree\n"
