"""Losses of a live sensor over loopback, and what receiving it costs.

    python -m tools.bench.loopback ADDRESS SECONDS [-- ARGUMENT ...]

ADDRESS is that of the sensor, as velodyne://127.0.0.1:2368. `tools.send.packets` sends with the arguments after --
for SECONDS to its port in a process of its own, on another core where there is one. Printed: packets sent, the counts
of the stream, datagrams that the kernel dropped for want of room, CPU time a sweep, and how long a complete sweep
waited before it was taken.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np

from modt.schemes import open_sensor
from modt.sources.live.live_stream import LiveStream
from tools.options import parser


def kernel_drops(port: int) -> int:
    """Datagrams dropped at the sockets of a port."""
    rows = [line.split() for line in Path("/proc/net/udp").read_text().splitlines()[1:]]
    return sum(int(row[-1]) for row in rows if int(row[1].rpartition(":")[2], 16) == port)


def measured(live: LiveStream, sender: subprocess.Popen[str]) -> list[float]:
    """Time from the arrival of each sweep until it was taken [s], until the sender ends."""
    waits_s = []
    while True:
        ended = sender.poll() is not None
        received = live.take(0.5)
        if received is not None:
            waits_s.append(time.monotonic() - received.arrived_s)
        elif ended:
            return waits_s


def main() -> None:
    options = parser(__doc__)
    options.add_argument("address", metavar="ADDRESS")
    options.add_argument("seconds", type=float, metavar="SECONDS")
    options.add_argument("sent", nargs="*", metavar="ARGUMENT", help="of tools.send.packets")
    arguments = options.parse_args()
    port = urlsplit(arguments.address).port or 0
    core, *others = sorted(os.sched_getaffinity(0))
    live = open_sensor(arguments.address, frozenset({core}))
    live.start()
    command = [sys.executable, "-m", "tools.send.packets", f"127.0.0.1:{port}", *arguments.sent]
    command += ["--seconds", str(arguments.seconds)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as sender:
        if others:
            os.sched_setaffinity(sender.pid, others)
        first = live.take(60.0)
        began_s = time.process_time()
        waits_s = measured(live, sender) if first else []
        cpu_ms = 1e3 * (time.process_time() - began_s)
        print(sender.communicate()[0].strip(), live.health(), sep="\n")
    print(f"dropped by the kernel: {kernel_drops(port)}")
    if waits_s:
        print(
            f"CPU {cpu_ms / len(waits_s):.2f} ms a sweep; taken after {1e3 * np.quantile(waits_s, 0.99):.2f} ms (p99)"
        )
    live.close()


if __name__ == "__main__":
    main()
