"""CPU time of decoding a sweep of packets.

    python -m tools.bench.packets CAPTURE [CAPTURE ...] [--metadata FILE] [--calibration FILE] [--rounds N]

Each CAPTURE is a PCAP file of a Velodyne or, with --metadata or a .json of its name beside it, of an Ouster. The time
is that of the thread, without reading the file, the median of the rounds.
"""

from __future__ import annotations

import time
from pathlib import Path
from statistics import median

from modt.sources.live.sweep_reader import Reception
from modt.sources.packets.open_capture import open_capture
from tools.options import parser


def main() -> None:
    options = parser(__doc__)
    options.add_argument("captures", type=Path, nargs="+", metavar="CAPTURE")
    options.add_argument("--metadata", metavar="FILE")
    options.add_argument("--calibration", metavar="FILE")
    options.add_argument("--rounds", type=int, default=5)
    arguments = options.parse_args()
    given = {"metadata": arguments.metadata, "calibration": arguments.calibration}
    for path in arguments.captures:
        stream = open_capture(path, {key: value for key, value in given.items() if value})
        datagrams, times_ms = list(stream.capture), []
        for _ in range(arguments.rounds):
            decoder, reception, points = stream.decoder.again(), Reception(), []
            began_s = time.thread_time()
            for datagram in datagrams:
                sweeps = decoder.decode(datagram.stamp_s, datagram.payload, reception)
                points += [len(sweep.points) for sweep in sweeps]
            times_ms.append(1e3 * (time.thread_time() - began_s))
        share_ms = median(times_ms) * stream.info.period_s / (datagrams[-1].stamp_s - datagrams[0].stamp_s)
        per_packet_us = 1e3 * median(times_ms) / len(datagrams)
        print(
            f"{path.stem}: {len(points)} sweeps of {median(points):.0f} points, {share_ms:.2f} ms a sweep of "
            f"{stream.info.period_s} s, {per_packet_us:.1f} us a packet"
        )


if __name__ == "__main__":
    main()
