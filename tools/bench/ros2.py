"""CPU time that a sweep costs as a ROS 2 message: reading its bytes, and receiving it from another process.

The receiving is told apart by thread: Cyclone's `recv` puts the fragments together, the receiver copies and reads
them, and the loop takes the sweep.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

from modt import host
from tools.options import parser

DOMAIN = 97


def main() -> None:
    options = parser(__doc__)
    options.add_argument("path", type=Path, help="stream")
    options.add_argument("--frames", type=int, default=100)
    options.add_argument("--rate", type=float, default=1.0, help="times the pace of the sensor")
    arguments = options.parse_args()
    host.pin_to_core(None)
    host.keep_freed_pages()
    _reading(arguments)
    _receiving(arguments)


def _reading(arguments: argparse.Namespace) -> None:
    from modt.ros2.point_cloud2 import read_cloud, write_cloud
    from modt.sources.recognise import open_stream

    frames = list(open_stream(arguments.path).between(0, 10))
    messages = [write_cloud(1.0, "lidar", frame.points) for frame in frames]
    read_cloud(messages[0])
    began_ns = time.thread_time_ns()
    for message in messages:
        read_cloud(message)
    points = sum(len(frame.points) for frame in frames) / len(frames)
    print(f"reading {points:.0f} points: {1e-6 * (time.thread_time_ns() - began_ns) / len(messages):.2f} ms")


def _receiving(arguments: argparse.Namespace) -> None:
    from modt.schemes import open_sensor

    live = open_sensor(f"ros2:///points?domain={DOMAIN}")
    live.start()
    command = [sys.executable, "-m", "tools.send.ros2", str(arguments.path), f"--domain={DOMAIN}"]
    with subprocess.Popen([*command, f"--frames={arguments.frames}", f"--rate={arguments.rate}"]) as sender:
        while live.take(1.0) is None and sender.poll() is None:
            pass
        sweeps, before = live.sweeps, threads()
        while sender.poll() is None:
            live.take(1.0)
        taken, after = max(live.sweeps - sweeps, 1), threads()
    used_ms = {thread: 1e3 * (after[thread][1] - before[thread][1]) / taken for thread in before}
    source_ms = sum(used_ms.values()) - used_ms[str(os.getpid())]
    print(
        f"received {live.sweeps} of {arguments.frames} sweeps: {source_ms:.2f} ms each in the threads of the source"
    )
    for thread, ms in used_ms.items():
        print(f"  {'(the loop)' if thread == str(os.getpid()) else after[thread][0]:<12}{ms:8.2f} ms")
    print(live.health())
    live.close()
    before_s = time.process_time()
    threading.Event().wait(2.0)
    print(f"without a sender: {50 * (time.process_time() - before_s):.2f} % of a core")


def threads() -> dict[str, tuple[str, float]]:
    """Name and CPU time [s] of each thread."""
    tick = os.sysconf("SC_CLK_TCK")
    found = {}
    for task in Path("/proc/self/task").iterdir():
        name, _, rest = (task / "stat").read_text().partition("(")[2].rpartition(") ")
        fields = rest.split()
        found[task.name] = name, (int(fields[11]) + int(fields[12])) / tick
    return found


if __name__ == "__main__":
    main()
