"""Progress of long commands."""

import pytest

from modt.cli import progress

pytest.importorskip("tqdm")


@pytest.mark.parametrize(("total", "lines"), [(2, ["0 of 2 frames", "1 of 2 frames", "2 of 2 frames"]), (None, [])])
def test_without_a_terminal_progress_is_lines(monkeypatch, capsys, total, lines):
    monkeypatch.setattr(progress, "LINE_S", 0.0)
    with progress.bar(total, "frame", shown=True) as step:
        for _ in range(2):
            step("3 proposals")
    written = capsys.readouterr().err.splitlines()
    assert len(written) == 3
    assert all(line.startswith("modt: ") for line in written)
    assert all(word in line for word, line in zip(lines, written, strict=False))
    assert all(("left" in line) is (total is not None) for line in written), "an expected time, where it is known"
    assert written[-1].endswith("3 proposals")


def test_a_short_command_shows_no_line(capsys):
    with progress.bar(2, "frame", shown=True) as step:
        step("")
    assert capsys.readouterr().err == ""


def test_nothing_is_shown_that_is_not_asked_for(monkeypatch, capsys):
    monkeypatch.setattr(progress, "LINE_S", 0.0)
    with progress.bar(2, "frame", shown=False) as step:
        step("")
    assert capsys.readouterr().err == ""
