"""Sends the packets of an ideal VLP-16 to a port of this machine, with the fault whose name was read last.

    python -m tools.deploy.sender PORT [DRIVE]

The recording is sent forwards and backwards in turn, since a robot that leaps from its end to its begin would be a
fault of its own. It writes a line when it begins to send, and ends with its standard input.
"""

from __future__ import annotations

import os
import socket
import sys
import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import count, takewhile
from pathlib import Path
from threading import Thread

import numpy as np

from modt.app.inputs import Request, stream
from modt_simulation.sensors import sensor
from modt_simulation.synthetic_stream import SyntheticStream
from tools.deploy.faults import FAULTS, NO_FAULT, Fault
from tools.options import parser
from tools.send.faults import Timed
from tools.send.ideal_packets import packets_of
from tools.send.loops import VelodyneStamps, turn_loop
from tools.send.packets import send

MODEL = "vlp-16"
FRAMES = 150
"""Number of frames that are sent."""


class Faulty:
    """Packets with one fault after the other.

    Attributes:
        fault: the present one.
    """

    def __init__(self) -> None:
        self.fault = NO_FAULT
        self._set_s = 0.0
        self._rng = np.random.default_rng(0)

    def applied(self, packets: Iterable[Timed]) -> Iterator[Timed]:
        """The packets as the sensor and the network leave them."""
        for seed in count():
            fault = self.fault
            self._set_s += self.fault.clock_s
            of_fault = takewhile(lambda _, now=fault: self.fault is now, packets)  # type: ignore[misc]
            changed = ((at_s, self._changed(fault, payload)) for at_s, payload in of_fault)
            yield from replace(fault.network, seed=seed).applied(changed)

    def _changed(self, fault: Fault, payload: bytes) -> bytes:
        stamps = VelodyneStamps()
        stamp_us = stamps.stamp_us(payload) + round(1e6 * self._set_s)
        return fault.packet(stamps.stamped(payload, stamp_us % stamps.wrap_us), self._rng)

    def apply_named(self, names: Iterable[str]) -> None:
        """Take each fault that is named; end the process with the names."""
        faults = {fault.name: fault for fault in FAULTS}
        for name in names:
            self.fault = faults.get(name.strip(), NO_FAULT)
        os._exit(0)


def paced(packets: Iterable[Timed]) -> Iterator[Timed]:
    """Packets, each at its time. A packet that a fault then removes takes as long as any other."""
    began_s = time.monotonic()
    for at_s, payload in packets:
        time.sleep(max(began_s + at_s - time.monotonic(), 0.0))
        yield at_s, payload


def yard() -> SyntheticStream:
    """A drive at the pace of a robot, so that it can turn back from one sweep to the next."""
    return SyntheticStream("yard", MODEL, FRAMES * sensor(MODEL).period_s)


def main() -> None:
    options = parser(__doc__)
    options.add_argument("port", type=int, metavar="PORT", help="UDP port of this machine")
    options.add_argument("drive", nargs="?", type=Path, metavar="DRIVE", help="recording (default: a simulated yard)")
    args = options.parse_args()
    drive = stream(Request(path=args.drive, frames=(0, FRAMES))) if args.drive else yard()
    there = list(drive)
    back = there[-2:0:-1]
    payloads = [payload for _, payload in packets_of([*there, *back], MODEL, drive.info.period_s)]
    faulty = Faulty()
    Thread(target=faulty.apply_named, args=(sys.stdin,), daemon=True).start()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as to:
        to.connect(("127.0.0.1", args.port))
        print("sending", flush=True)
        send(faulty.applied(paced(turn_loop(payloads))), to)


if __name__ == "__main__":
    main()
