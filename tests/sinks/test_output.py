"""Properties of all sinks of files."""

import threading

from modt.sinks.output import close_together, replace_file


def test_sinks_that_hang_are_closed_together():
    meeting = threading.Barrier(3, timeout=60.0)

    class Hanging:
        def close(self):
            meeting.wait()

    close_together([Hanging(), Hanging(), Hanging()])
    assert not meeting.broken


def test_a_file_is_replaced_without_following_a_planted_link(tmp_path):
    victim = tmp_path / "victim"
    victim.write_text("kept")
    (tmp_path / ".run.yaml.part").symlink_to(victim)
    replace_file(tmp_path / "run.yaml", "new")
    assert victim.read_text() == "kept"
    assert (tmp_path / "run.yaml").read_text() == "new"
    assert not (tmp_path / "run.yaml").is_symlink()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.yaml", "victim"]


def test_a_partial_file_of_a_crash_is_replaced(tmp_path):
    (tmp_path / ".run.yaml.part").write_text("half")
    replace_file(tmp_path / "run.yaml", "new", lasting=True)
    assert [path.name for path in tmp_path.iterdir()] == ["run.yaml"]
