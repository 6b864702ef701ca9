"""`modt top` in a terminal of its own."""

import fcntl
import json
import os
import pty
import struct
import subprocess
import sys
import termios
import time
from select import select

import pytest

from tests.results import status

from .commands import environment, here, refusal

pytestmark = pytest.mark.command

DEADLINE_S = 60.0


def write(folder, content):
    partial = folder / "partial"
    partial.write_text(json.dumps(content))
    partial.rename(folder / "status.json")


def test_in_a_terminal_the_page_follows_the_status_until_ctrl_c(tmp_path):
    write(tmp_path, status())
    side, far = pty.openpty()
    fcntl.ioctl(far, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 60, 0, 0))
    # The first terminal that a session opens is its own: Ctrl-C in it reaches the command.
    opened = ["sh", "-c", 'exec "$@" <"$0" >"$0" 2>&1', os.ttyname(far)]
    command = [*opened, sys.executable, "-m", "modt.cli.main", "top", str(tmp_path)]
    process = subprocess.Popen(command, env=environment(), start_new_session=True)
    shown = ""

    def read_until(text):
        nonlocal shown
        end_s = time.monotonic() + DEADLINE_S
        while text not in shown:
            ready, _, _ = select([side], [], [], max(end_s - time.monotonic(), 0))
            assert ready, f"no {text!r} in {shown!r}"
            shown += os.read(side, 4096).decode()
        before, _, shown = shown.partition(text)
        return before

    try:
        page = read_until("udp://x")
        assert "10.0 Hz, 7 tracks (2 car)" in page
        assert "a?[2Jb" in page, "escape sequences are replaced"
        write(tmp_path, status(rate_hz=5.0))
        read_until("5.0 Hz")
        (tmp_path / "status.json").unlink()
        read_until("no status")
        write(tmp_path, status(rate_hz=7.0))
        read_until("7.0 Hz")
        os.write(side, b"\x03")
        assert process.wait(DEADLINE_S) == 0
    finally:
        process.kill()
        process.wait()
        os.close(side)
        os.close(far)


def test_without_a_terminal_it_is_printed_once(tmp_path, capsys):
    assert refusal(capsys, "top", tmp_path)
    write(tmp_path, status(stages_J={}))
    assert here("top", tmp_path) == 0
    assert "10.0 Hz, 7 tracks" in capsys.readouterr().out
