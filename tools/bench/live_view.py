"""CPU time of the loop's thread for the live page, with nobody who looks, with readers, and with one that stalls."""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from modt import host
from tools.options import parser

READ = """
import sys, urllib.request
with urllib.request.urlopen(f"http://127.0.0.1:{sys.argv[1]}/events") as events:
    print("open", flush=True)
    print(sum(line.startswith(b"data") for line in events), flush=True)
"""


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--tracks", type=int, default=400)
    options.add_argument("--points", type=int, default=120_000)
    options.add_argument("--frames", type=int, default=60)
    options.add_argument("--period", type=float, default=0.1, metavar="S")
    arguments = options.parse_args()
    core = host.last_core()
    cores = host.other_cores(core)
    host.pin_to_core(core)
    from modt.schemes import open_sink
    from modt.sinks.output import LedgerSink
    from tools.bench.sinks import frame_result

    results = [frame_result(k, arguments.tracks, arguments.points) for k in range(arguments.frames)]
    line = {"schema": "modt.ledger/1", "stages": {"tracking": {"cpu_ns": 1_000_000}}}
    for name, readers, stalled in (("nobody looks", 0, 0), ("a reader", 1, 0), ("a reader, one stalls", 1, 1)):
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        with host.threads_on(cores):
            sink = open_sink(f"view://127.0.0.1:{port}")
        assert isinstance(sink, LedgerSink)
        cpu_ns = worst_ns = 0
        with looking(port, readers, stalled) as processes:
            process0_ns = time.process_time_ns()
            for result in results:
                time.sleep(arguments.period)
                began_ns, wall0_ns = time.thread_time_ns(), time.perf_counter_ns()
                sink.write(result)
                sink.ledger(line | {"frame": result.frame.index})
                cpu_ns += time.thread_time_ns() - began_ns
                worst_ns = max(worst_ns, time.perf_counter_ns() - wall0_ns)
            all_ns = time.process_time_ns() - process0_ns
            time.sleep(0.5)
            sink.close()
            seen = [process.communicate()[0].split()[-1] for process in processes]
        loop_ms, others_ms = (1e-6 * t / len(results) for t in (cpu_ns, all_ns - cpu_ns))
        print(
            f"{name:<22}{loop_ms:8.3f} ms of the loop a frame, at most {1e-6 * worst_ns:.2f} ms; "
            f"other threads {others_ms:.1f} ms; frames seen {', '.join(seen) or '-'} of {len(results)}"
        )


@contextmanager
def looking(port: int, readers: int, stalled: int) -> Iterator[list[subprocess.Popen[str]]]:
    """Processes that read events, and connections that ask for them and never read."""
    command = [sys.executable, "-c", READ, str(port)]
    processes = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(readers)]
    for process in processes:
        assert process.stdout is not None
        process.stdout.readline()
    silent = [socket.create_connection(("127.0.0.1", port)) for _ in range(stalled)]
    for connection in silent:
        connection.sendall(b"GET /events HTTP/1.0\r\nHost: localhost\r\n\r\n")
    yield processes
    for connection in silent:
        connection.close()


if __name__ == "__main__":
    main()
