"""`modt top` in a terminal of its own."""

import fcntl
import json
import os
import pty
import signal
import struct
import subprocess
import sys
import termios
import time
from select import select

import pytest

from .commands import environment, modt

pytestmark = pytest.mark.command

DEADLINE_S = 60.0


def status(rate_hz=9.96, **power):
    times = {"p50": 0.1, "p99": 0.9}
    return {
        "schema": "modt.status/1",
        "time_s": time.time(),
        "up_s": 2.0,
        "source": "a\x1b[2Jb",
        "mode": "accurate",
        "profile": "vlp-16",
        "counts": {"rate_hz": rate_hz, "tracks": 7, "visible": {"background": 3, "car": 2}},
        "loop": {
            "frames": 20,
            "missed_deadlines": 1,
            "shed_sweeps": 0,
            **dict.fromkeys(("lateness_ms", "execution_ms", "latency_ms"), times),
            "budget_ms": 80.0,
            "other_stages_ms": 12.0,
            "step": "reduced",
            "steps_entered": {"reduced": 1},
            "failures": {},
        },
        "power": {"watts": 6.25, "kind": "estimated", "frame_J": 0.6, "stages_J": {"segmentation": 0.25}, **power},
        "sensor": {"lost_messages": 4, "silent": False},
        "sinks": {"udp://x": {"written": 5, "state": "ok"}},
        "recording": {"lines": 40, "lost_lines": 0, "failing": None},
        "host": {"lacking": []},
    }


def write(folder, content):
    partial = folder / "partial"
    partial.write_text(json.dumps(content))
    partial.rename(folder / "status.json")


class Terminal:
    """A terminal, by default of 24 rows of 60, in which the command runs."""

    def __init__(self, folder, rows=24, columns=60):
        self.side, self.far = pty.openpty()
        fcntl.ioctl(self.far, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
        self.mode = termios.tcgetattr(self.far)
        # A session's first terminal that it opens is its own: Ctrl-C in it reaches the command.
        opened = ["sh", "-c", 'exec "$@" <"$0" >"$0" 2>&1', os.ttyname(self.far)]
        command = [*opened, sys.executable, "-m", "modt.cli.main", "top", str(folder)]
        self.process = subprocess.Popen(command, env=environment(), start_new_session=True)
        self.said = ""

    def read_until(self, text):
        """What was written up to there and was not read before; the test fails if it never comes."""
        end_s = time.monotonic() + DEADLINE_S
        while text not in self.said:
            ready, _, _ = select([self.side], [], [], max(end_s - time.monotonic(), 0))
            assert ready, f"no {text!r} in {self.said!r}"
            self.said += os.read(self.side, 4096).decode()
        before, _, self.said = self.said.partition(text)
        return before

    def type(self, keys):
        os.write(self.side, keys.encode())

    def close(self):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        os.close(self.side)
        os.close(self.far)


@pytest.fixture(name="terminal")
def _terminal(tmp_path):
    write(tmp_path, status())
    terminal = Terminal(tmp_path)
    yield terminal
    terminal.close()


def end_of(terminal):
    """The exit status, and whether the terminal is as it was."""
    terminal.read_until("\x1b[?25h\x1b[?1049l")
    code = terminal.process.wait(DEADLINE_S)
    return code, termios.tcgetattr(terminal.far) == terminal.mode


def test_the_page_follows_the_status_until_q(terminal, tmp_path):
    page = terminal.read_until("q ends")
    assert page.startswith("\x1b[?1049h\x1b[?25l\x1b[H")
    for words in (
        "10.0 Hz, 7 tracks (2 car)",
        "1 of 20 missed",
        "80.0 ms",
        "reduced",
        "segmentation 250.0",
        "lost messages 4",
        "udp://x",
        "a?[2Jb",
    ):
        assert words in page
    assert max(len(row) for row in page.split("\x1b[H")[1].split("\r\n")) < 60 + len("\x1b[1m\x1b[K\x1b[0m")
    write(tmp_path, status(rate_hz=5.0))
    terminal.read_until("5.0 Hz")
    (tmp_path / "status.json").unlink()
    terminal.read_until("no status")
    write(tmp_path, status(rate_hz=7.0))
    terminal.read_until("7.0 Hz")
    terminal.type("xq")
    assert end_of(terminal) == (0, True)


def test_ctrl_c_and_sigterm_leave_the_terminal_as_it_was(terminal, tmp_path):
    terminal.read_until("q ends")
    terminal.type("\x03")
    assert end_of(terminal) == (0, True)
    other = Terminal(tmp_path)
    try:
        other.read_until("q ends")
        other.process.send_signal(signal.SIGTERM)
        assert end_of(other) == (143, True)
    finally:
        other.close()


@pytest.mark.parametrize("size", [(0, 0), (24, 0), (0, 60), (1, 1)])
def test_a_terminal_of_any_size_shows_a_page(tmp_path, size):
    write(tmp_path, status())
    terminal = Terminal(tmp_path, *size)
    try:
        page = terminal.read_until("\x1b[J")
        assert size == (1, 1) or "q ends" in page
        terminal.type("q")
        assert end_of(terminal) == (0, True)
    finally:
        terminal.close()


def test_without_a_terminal_it_is_printed_once(tmp_path):
    missing = modt("top", tmp_path, cwd=tmp_path)
    assert (missing.returncode, missing.stderr.count("\n")) == (2, 1)
    write(tmp_path, status(stages_J={}))
    done = modt("top", tmp_path, cwd=tmp_path, stdin=subprocess.DEVNULL)
    assert (done.returncode, done.stderr) == (0, "")
    assert "10.0 Hz, 7 tracks" in done.stdout
    assert "by stage" not in done.stdout
    assert "?1049" not in done.stdout
