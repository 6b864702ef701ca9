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


def test_in_a_terminal_the_page_follows_the_status_until_ctrl_c(tmp_path):
    write(tmp_path, status())
    side, far = pty.openpty()
    fcntl.ioctl(far, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 60, 0, 0))
    # A session's first terminal that it opens is its own: Ctrl-C in it reaches the command.
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
        for words in (
            "10.0 Hz, 7 tracks (2 car)",
            "1 of 20 missed",
            "segmentation 250.0",
            "lost messages 4",
            "a?[2Jb",
        ):
            assert words in page
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


def test_without_a_terminal_it_is_printed_once(tmp_path):
    missing = modt("top", tmp_path, cwd=tmp_path)
    assert (missing.returncode, missing.stderr.count("\n")) == (2, 1)
    write(tmp_path, status(stages_J={}))
    done = modt("top", tmp_path, cwd=tmp_path, stdin=subprocess.DEVNULL)
    assert (done.returncode, done.stderr) == (0, "")
    assert "10.0 Hz, 7 tracks" in done.stdout
    assert "by stage" not in done.stdout
