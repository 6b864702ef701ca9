"""CPU time a frame of each sink, on the loop's thread and on the others."""

from __future__ import annotations

import argparse
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from modt import host

if TYPE_CHECKING:
    from modt.types import FrameResult


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("sinks", nargs="*", help="addresses (default: one of each kind, and nobody who receives)")
    options.add_argument("--tracks", type=int, default=60)
    options.add_argument("--points", type=int, default=120_000)
    options.add_argument("--frames", type=int, default=40)
    options.add_argument("--period", type=float, default=0.1, metavar="S")
    arguments = options.parse_args()
    host.pin_to_core(host.last_core())
    from modt.schemes import open_sink

    results = [frame_result(k, arguments.tracks, arguments.points) for k in range(arguments.frames)]
    with receivers() as known:
        for text in arguments.sinks or known:
            sink = open_sink(text)
            sink.write(results[0])
            cpu_ns, process0_ns, worst_ns = 0, time.process_time_ns(), 0
            for result in results[1:]:
                time.sleep(arguments.period)
                began_ns, wall0_ns = time.thread_time_ns(), time.perf_counter_ns()
                sink.write(result)
                cpu_ns += time.thread_time_ns() - began_ns
                worst_ns = max(worst_ns, time.perf_counter_ns() - wall0_ns)
            sink.close()
            loop_ms, all_ms = (1e-6 * t / (len(results) - 1) for t in (cpu_ns, time.process_time_ns() - process0_ns))
            name = f"{text.partition('://')[0]} {text.partition('?')[2]}"
            others = f"at most {1e-6 * worst_ns:6.2f} ms; others {all_ms - loop_ms:8.3f} ms"
            print(f"{name:<20}{loop_ms:8.3f} ms, {others}  {sink.health()}")


def frame_result(index: int, n_tracks: int, n_points: int) -> FrameResult:
    """A frame of so many tracks, a third of them of objects, each with its proposal, and so many points."""
    import numpy as np

    from modt.types import Frame, FrameResult, Proposals, Tracks

    rng = np.random.default_rng(index)
    points = rng.normal(0.0, 20.0, (n_points, 4)).astype(np.float32)
    offsets = np.linspace(0, n_points // 4, n_tracks + 1).astype(np.int64)
    members = np.arange(offsets[-1])
    box = np.c_[
        rng.uniform(-60, 60, (n_tracks, 2)), rng.uniform(0.3, 4.0, (n_tracks, 4)), rng.uniform(-3, 3, n_tracks)
    ]
    tracks = Tracks.blank(n_tracks)
    tracks.id[:] = tracks.proposal[:] = np.arange(n_tracks)
    tracks.object_class[::3] = 1
    tracks.x[:], tracks.box[:] = rng.normal(0.0, 5.0, (n_tracks, 4)), box
    cut = np.zeros(n_tracks, np.int64)
    proposals = Proposals(members, offsets, points[members, :3].T.copy(), box[:, :3], box, cut)
    return FrameResult(Frame(index, 0.1 * index, points), np.eye(4), proposals, tracks, ("tracked",), 0)


@contextmanager
def receivers() -> Iterator[list[str]]:
    """Addresses of every sink that needs no other machine; what is sent to them is read by nobody."""
    with TemporaryDirectory() as name, ExitStack() as stack:
        folder = Path(name)
        unix = stack.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM))
        unix.bind(str(folder / "unix"))
        udp = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        udp.bind(("127.0.0.1", 0))
        udp_address = f"udp://127.0.0.1:{udp.getsockname()[1]}"
        files = [f"file://{folder}/tracks.jsonl", f"mcap://{folder}/a.mcap", f"mcap://{folder}/b.mcap?points=none"]
        yield [f"unix://{folder}/unix", udp_address, *files, "foxglove://127.0.0.1:0"]


if __name__ == "__main__":
    main()
