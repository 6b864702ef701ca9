"""`modt top`: the page follows the status."""

import json
import sys
from pathlib import Path
from unittest.mock import Mock

import pytest

from modt.cli.status import CLEAR
from modt.sinks.run_directory import STATUS
from tests.results import status

from .commands import here, refusal

pytestmark = pytest.mark.command


@pytest.fixture(name="write")
def a_function_that_writes_the_status(tmp_path):
    return lambda **changes: (tmp_path / STATUS).write_text(json.dumps(status(**changes)))


def test_in_a_terminal_the_page_follows_the_status_until_ctrl_c(write, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    meanwhile = iter([lambda: write(rate_hz=5.0), (tmp_path / STATUS).unlink, lambda: write(rate_hz=7.0)])

    def sleep(seconds):
        for change in meanwhile:
            return change()
        raise KeyboardInterrupt

    monkeypatch.setattr("modt.cli.status.time.sleep", sleep)
    write()
    assert here("top", tmp_path) == 0
    first, *pages = capsys.readouterr().out.split(CLEAR)[1:]
    assert "10.0 Hz, 7 tracks (2 car)" in first
    assert "udp://x" in first
    assert "left out    ground 900, structure 60 points a frame" in first
    assert "a?[2Jb" in first, "escape sequences are replaced"
    assert [words in page for words, page in zip(("5.0 Hz", "no status", "7.0 Hz"), pages, strict=True)] == [True] * 3


def test_a_low_terminal_shows_the_first_lines(write, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setattr("modt.cli.status.time.sleep", Mock(side_effect=KeyboardInterrupt))
    monkeypatch.setenv("LINES", "4")
    write()
    assert here("top", tmp_path) == 0
    assert len(capsys.readouterr().out.splitlines()) == 3


def test_without_a_terminal_it_is_printed_once(write, tmp_path, capsys):
    assert refusal(capsys, "top", tmp_path)
    write(stages_J={})
    assert here("top", tmp_path) == 0
    assert "10.0 Hz, 7 tracks" in capsys.readouterr().out


@pytest.mark.parametrize("command", ["status", "top"])
def test_records_of_the_service_that_this_user_must_not_see_are_refused_in_one_line(command, monkeypatch, capsys):
    monkeypatch.setattr(Path, "exists", Mock(side_effect=PermissionError(13, "Permission denied")))
    assert "as root" in refusal(capsys, command, "/var/lib/modt/run")
