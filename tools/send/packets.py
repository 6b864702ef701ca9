"""Send a sensor's packets to a UDP address at the sensor's pace.

    python -m tools.send.packets 127.0.0.1:2368 CAPTURE.pcap [--metadata FILE.json] [--once] [--seconds S]
    python -m tools.send.packets 127.0.0.1:2368 BAG --write FILE.pcap
    python -m tools.send.packets 127.0.0.1:2368 [STREAM] --as hdl-64e --calibration FILE.yaml [--frames A:B]
    ... --loss P --duplicates P --reordering P --garbage P --seed N
    ... --write FILE.pcap

The whole turns of a capture are repeated as if the sensor went on, until --seconds are over; --once sends the capture
unchanged. A BAG is a ROS 2 recording (.db3) of a driver's packets, which are sent once. A STREAM of scans (a KITTI
drive; default: the synthetic street) is turned into the packets of an ideal sensor, whose calibration is written to
FILE.yaml for the receiver. Faults are shares of the packets; the seed determines them. With --write the packets go to
a file instead.
"""

from __future__ import annotations

import argparse
import socket
import time
from collections.abc import Callable, Iterable, Iterator
from itertools import takewhile
from pathlib import Path

from modt.cli.options import bounded, frames
from modt.errors import ModtError
from modt.sources.capture import open_capture
from modt.sources.recognise import CAPTURES, open_stream
from modt_simulation.synthetic_stream import SyntheticStream
from tools.options import parser
from tools.send.faults import PacketFaults, Timed
from tools.send.ideal_packets import LAYOUTS, MODELS, ideal_calibration, packets_of
from tools.send.loops import endless, ouster_loop
from tools.send.packet_bag import packets_of_bag
from tools.send.pcap_writer import write_capture

SYNTHETIC_S = 5.0


def send(
    packets: Iterable[Timed],
    to: socket.socket,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> int:
    """Send payloads over a connected socket, each at its time from now on; returns their number."""
    began_s = clock()
    sent = 0
    for at_s, payload in packets:
        early_s = began_s + at_s - clock()
        if early_s > 0:
            sleep(early_s)
        try:
            to.send(payload)
        except ConnectionRefusedError:  # nobody listens yet; a sensor sends all the same
            continue
        sent += 1
    return sent


def captured(path: Path, metadata: Path | None, *, once: bool) -> Iterator[Timed]:
    """Packets of a capture, as they are or endlessly."""
    stream = open_capture(path, {"metadata": str(metadata)} if metadata else {})
    datagrams = list(stream.capture)
    if once:
        return ((d.stamp_s - datagrams[0].stamp_s, d.payload) for d in datagrams)
    payloads = [d.payload for d in datagrams]
    if stream.info.layout.startswith("Ouster"):
        return ouster_loop(payloads, metadata or path.with_suffix(".json"))
    return endless(payloads)


def made(path: Path | None, model: str, calibration: Path | None, part: tuple[int, int | None]) -> list[Timed]:
    """Packets of an ideal sensor that saw the sweeps of a stream, followed by those of the stream again."""
    if calibration is not None and model in LAYOUTS:
        calibration.write_text(ideal_calibration(LAYOUTS[model]), encoding="utf-8")
    stream = SyntheticStream("street", model, SYNTHETIC_S) if path is None else open_stream(path)
    return [*packets_of([*stream.between(*part)], model, stream.info.period_s)]


def main() -> None:
    options = parser(__doc__)
    options.add_argument("address", metavar="HOST:PORT")
    options.add_argument("path", type=Path, nargs="?", help="capture or stream")
    options.add_argument("--metadata", type=Path, help="of an Ouster (default: the capture's name with .json)")
    options.add_argument("--as", dest="model", choices=MODELS, default="vlp-16", help="default: %(default)s")
    options.add_argument("--calibration", type=Path, help="file to write, of the ideal sensor")
    options.add_argument("--frames", type=frames, default=(0, None), metavar="A:B", help="of a stream")
    options.add_argument("--once", action="store_true", help="do not repeat")
    options.add_argument("--seconds", type=float, default=float("inf"), help="default: until it is ended")
    options.add_argument("--write", type=Path, metavar="FILE", help="PCAP file to write instead of sending")
    share = bounded(float, 0.0, 1.0, "a share")
    for name in ("loss", "duplicates", "reordering", "garbage"):
        options.add_argument(f"--{name}", type=share, default=0.0, metavar="SHARE")
    options.add_argument("--seed", type=int, default=0)
    try:
        run(options.parse_args())
    except ModtError as error:
        raise SystemExit(f"send: {error}") from None


def run(arguments: argparse.Namespace) -> None:
    host, _, port = arguments.address.rpartition(":")
    packets: Iterable[Timed]
    path = arguments.path
    if path is not None and (path.suffix == ".db3" or (path.is_dir() and any(path.glob("*.db3")))):
        packets = packets_of_bag(path)
    elif path is not None and path.suffix in CAPTURES:
        packets = captured(path, arguments.metadata, once=arguments.once)
    else:
        packets = made(path, arguments.model, arguments.calibration, arguments.frames)
        if not arguments.once:
            packets = endless([payload for _, payload in packets])
    faults = PacketFaults(
        arguments.loss, arguments.duplicates, arguments.reordering, arguments.garbage, arguments.seed
    )
    packets = faults.applied(takewhile(lambda timed: timed[0] < arguments.seconds, packets))
    if arguments.write is not None:
        write_capture(arguments.write, packets, int(port))
        return
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as to:
        to.connect((host, int(port)))
        print(f"{send(packets, to)} packets sent")


if __name__ == "__main__":
    main()
