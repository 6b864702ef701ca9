"""Deadlines missed, lateness and latency of `modt run`, fed at the sensor's pace by a process of its own.

    python -m tools.bench.lateness packets|ros2|played DRIVE [--frames N] [-- ARGUMENT ...]

The drive comes as packets of an ideal HDL-64E, as ROS 2 messages, or from the reader of `modt run` itself, as if
live. The sender runs on other cores than the loop. ARGUMENTs go to `modt run`.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from modt import host
from tools.options import parser
from tools.send.ideal_packets import LAYOUTS, ideal_calibration

PORT, DOMAIN = 23_680, 96
LONGEST_S = 120.0


def main() -> None:
    options = parser(__doc__)
    options.add_argument("kind", choices=("packets", "ros2", "played"))
    options.add_argument("drive")
    options.add_argument("--frames", type=int, default=300, metavar="N", help="default: %(default)s")
    options.add_argument("arguments", nargs="*", metavar="ARGUMENT", help="of modt run")
    given = options.parse_args()
    core = host.last_core()
    with TemporaryDirectory() as folder:
        source, sender = fed(given.kind, given.drive, Path(folder) / "calibration.yaml")
        out = Path(folder) / "run"
        run = ["-m", "modt", "run", source, "--core", str(core), "--out", str(out), *given.arguments]
        with subprocess.Popen([sys.executable, *run]) as loop:
            os.sched_setaffinity(0, host.other_cores(core) or {core})  # this process, and the sender
            with subprocess.Popen([sys.executable, *sender], stdout=subprocess.DEVNULL) as feeding:
                status = after(out / "status.json", given.frames, loop)
                loop.send_signal(signal.SIGTERM)
                feeding.kill()
    print(figures(status))


def fed(kind: str, drive: str, calibration: Path) -> tuple[str, list[str]]:
    """Address for `modt run`, and arguments of the Python that feeds it."""
    if kind == "packets":
        calibration.write_text(ideal_calibration(LAYOUTS["hdl-64e"]), encoding="utf-8")
        address = f"velodyne://127.0.0.1:{PORT}?model=hdl-64e&calibration={calibration}"
        return address, ["-m", "tools.send.packets", f"127.0.0.1:{PORT}", drive, "--as", "hdl-64e"]
    if kind == "ros2":
        sender = ["-m", "tools.send.ros2", drive, "--loops=0", f"--domain={DOMAIN}"]
        return f"ros2:///points?domain={DOMAIN}", sender
    return f"{drive}?loop=yes", ["-c", ""]


def after(path: Path, frames: int, loop: subprocess.Popen[bytes]) -> dict[str, Any]:
    """The status when there are so many frames, or the loop has ended."""
    until_s, status = time.monotonic() + LONGEST_S, dict[str, Any]()
    while loop.poll() is None and time.monotonic() < until_s:
        time.sleep(0.5)
        status = json.loads(path.read_text("utf-8")) if path.is_file() else {}
        if status and status["loop"]["frames"] >= frames:
            break
    return status


def figures(status: dict[str, Any]) -> str:
    """Sweeps missed and lost, and the times."""
    loop, sensor = status["loop"], status["sensor"]
    lost = f"{sensor['lost_messages']} messages lost, {sensor['dropped_sweeps']} sweeps dropped"
    missed = f"{loop['missed_deadlines']} of {loop['frames']} deadlines missed"
    times = (f"{name} {loop[f'{name}_ms']} ms" for name in ("lateness", "execution", "latency"))
    return "\n".join((f"{missed}, {lost}; {status['host']['resident_mb']:.0f} MB resident", *times))


if __name__ == "__main__":
    main()
