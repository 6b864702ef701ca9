"""Properties of all sinks of files."""

import threading

import pytest

from modt.sinks.output import close_together, replace_file


def test_sinks_that_hang_are_closed_together():
    meeting = threading.Barrier(3, timeout=60.0)

    class Hanging:
        def close(self):
            meeting.wait()

    close_together([Hanging(), Hanging(), Hanging()])
    assert not meeting.broken


@pytest.mark.parametrize("left", ["a link", "half a file"])
def test_a_file_is_replaced_whatever_was_left_in_its_place(tmp_path, left):
    victim = tmp_path / "victim"
    part = tmp_path / ".run.yaml.part"
    victim.write_text("kept")
    part.symlink_to(victim) if left == "a link" else part.write_text("half")
    replace_file(tmp_path / "run.yaml", "new", lasting=True)
    assert victim.read_text() == "kept"
    assert (tmp_path / "run.yaml").read_text() == "new"
    assert not (tmp_path / "run.yaml").is_symlink()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.yaml", "victim"]
