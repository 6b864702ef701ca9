"""Tries random pairs of faults over live runs: packets and poses are sent over sockets to a running `modt run`.

    python -m tools.live_fault_pairs --pairs 1000 --seed 1 --out runs/pairs.jsonl

Each pair gets a run of its own, in real time; several at once with `--parallel`. A pair that OUT holds is not run
again, so a run of this tool can be cut and continued. The faults are those of `tools.fault_pairs`, of the network and
of the process. A pair is listed if the run ended or did not end well when asked to, if a fault was silent (the trust
was good after its limit, or its counter stayed), or if a frame is neither recorded nor counted as lost. The exit
status is 0 if none is.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain, pairwise, repeat, takewhile
from pathlib import Path
from typing import Any

import numpy as np

from modt.types import Frame
from modt_simulation.synthetic_stream import SyntheticStream
from tools import fault_pairs
from tools.deploy.faults import FAULTS, NO_FAULT
from tools.deploy.sender import Faulty
from tools.fault_pairs import CHANGES, SECONDS, SENSOR, Change, Episode, faulty, pair_options, seen_from
from tools.send.faults import Timed
from tools.send.ideal_packets import packets_of
from tools.send.loops import VelodyneStamps

PERIOD_S = 0.1
POSES_PER_SWEEP = 5
WAITING = 9
"""Number of sweeps that are repeated until a run has its first frames: their packets are full."""
MOST_WAITING = 40
"""Most repetitions."""
PACKET_BYTES = 1206
PACKET_S = 24 * 55.296e-6
"""Time between two packets [s]."""
PACKETS_PER_SWEEP = round(PERIOD_S / PACKET_S)
MOST_LATE_S = 0.5
"""Greatest delay of a packet with which a pair counts [s]. The machine was too busy for it otherwise."""
ENDED_S = 15.0
"""Longest time until a run has ended after SIGTERM [s]."""
JITTER = 1e-3
"""Noise of the ranges while the robot waits for the run to start, as a share; without it the sweeps would repeat."""


@dataclass(frozen=True)
class OtherFault(Change):
    """A fault that the sweeps do not show: of the network, or a signal to the process. It has to be counted."""

    limit_s: float = np.inf
    signals: tuple[signal.Signals, ...] = ()
    counted: Callable[[dict[str, Any]], int] = lambda status: 0


def _sensor(*names: str) -> Callable[[dict[str, Any]], int]:
    return lambda status: sum(int(status["sensor"][name]) for name in names)


def _refused(status: dict[str, Any]) -> int:
    return sum(status["sensor"]["refused_messages"].values())


NETWORK = {
    "silence": _sensor("silences"),
    "garbage": _refused,
    "loss": _sensor("lost_messages", "incomplete_sweeps"),
    "duplicates": _refused,
    "reordering": lambda status: _refused(status) + _sensor("lost_messages", "incomplete_sweeps")(status),
    "lying stamps": _refused,
    "clock set back": _refused,
}
LIVE_FAULTS = (
    *CHANGES,
    *(OtherFault(name, counted=counter) for name, counter in NETWORK.items()),
    OtherFault("reload", signals=(signal.SIGHUP,), counted=lambda status: int(status["loop"]["reloads"])),
)


def drawn(rng: np.random.Generator) -> tuple[Episode, Episode]:
    """Two faults, of which one at most is of the network; the second one begins while the first one lasts."""
    while True:
        pair = fault_pairs.drawn(rng, LIVE_FAULTS)
        if not all(episode.change.name in NETWORK for episode in pair):
            return pair


class Sender:
    """Sends the packets of a drive and its poses, with the faults of a pair.

    Args:
        frames: sweeps of the drive.
        pair: its faults.
        ports: UDP ports of packets and poses.
        hang_up: sends a signal to the run.
        ready: whether the run has frames, so that the drive may begin.
    """

    def __init__(
        self,
        frames: Sequence[Frame],
        pair: Sequence[Episode],
        ports: tuple[int, int],
        hang_up: Callable[[signal.Signals], None],
        ready: Callable[[], bool],
    ) -> None:
        self._frames = frames
        self._pair = pair
        self._ports = ports
        self._hang_up = hang_up
        self._ready = ready
        self._faulty = Faulty()
        self.began_s = 0.0  # stamp of the first sweep of the drive
        self.latest_s = 0.0  # greatest delay of a packet, as on a busy machine

    @property
    def too_late(self) -> bool:
        """Whether the machine is too busy for the run to count."""
        return self.latest_s > MOST_LATE_S

    def _waiting(self) -> list[Frame]:
        """Sweeps at the begin of the drive, before the run is ready; without noise they would be frozen."""
        rng = np.random.default_rng(0)
        noise = 1 + rng.normal(0, JITTER, (WAITING, len(self._frames[0].points), 1)).astype(np.float32)
        first = self._frames[0]
        return [replace(first, points=np.hstack([first.points[:, :3] * n, first.points[:, 3:]])) for n in noise]

    def run(self) -> None:
        """Send the drive in real time, until it is too late. All that takes long is done before."""
        given = list(faulty(self._frames, self._pair))
        drive = [payload for _, payload in packets_of(given, SENSOR, PERIOD_S)]
        waiting = [payload for _, payload in packets_of(self._waiting(), SENSOR, PERIOD_S)]
        with (
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as packets,
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as poses,
        ):
            packets.connect(("127.0.0.1", self._ports[0]))
            poses.connect(("127.0.0.1", self._ports[1]))
            self.began_s = self._wait(packets, poses, waiting)
            for at_s, payload in self._let_through(self._drive(drive, given, poses)):
                self._send_packet(packets, payload, at_s)

    def _let_through(self, drive: Iterator[Timed]) -> Iterator[Timed]:
        """The packets of the drive as the faults leave them."""
        end = repeat((np.inf, bytes(PACKET_BYTES)))  # faults of an exhausted drive would be applied for ever
        return takewhile(lambda timed: timed[0] < np.inf, self._faulty.applied(chain(drive, end)))

    def _drive(self, drive: Sequence[bytes], given: Sequence[Frame], poses: socket.socket) -> Iterator[Timed]:
        """Each packet of the drive at its time, after the poses and the faults that are due.

        A fault that lets no packet through ends here, as this goes on meanwhile.
        """
        said = 0
        for k, payload in enumerate(drive):
            at_s = self.began_s + k * PACKET_S
            self._await(at_s)
            if self.too_late:
                self._faulty.fault = NO_FAULT
                return
            while said < min(int((at_s - self.began_s) / PERIOD_S), len(given) - 1):
                self._switch(said, said + 1)
                self._send_poses(poses, given[said : said + 2], self.began_s + said * PERIOD_S)
                said += 1
            yield at_s, _stamped(payload, at_s)

    def _wait(self, packets: socket.socket, poses: socket.socket, waiting: Sequence[bytes]) -> float:
        """Send sweeps of the beginning until the run is ready; returns the stamp of the next packet."""
        at_s = first_s = time.time()
        n = 0
        while n < MOST_WAITING * len(waiting) and not self.too_late and not (n and self._ready()):
            for payload in waiting:
                if n % PACKETS_PER_SWEEP == 0:
                    self._send_poses(poses, [self._frames[0]] * 2, at_s)
                self._send_packet(packets, _stamped(payload, at_s), at_s)
                n += 1
                at_s = first_s + n * PACKET_S
        return at_s

    def _send_packet(self, to: socket.socket, payload: bytes, at_s: float) -> None:
        """Send a packet at its time."""
        self._await(at_s)
        _send(to, payload)

    def _await(self, at_s: float) -> None:
        time.sleep(max(at_s - time.time(), 0.0))
        self.latest_s = max(self.latest_s, time.time() - at_s)

    def _switch(self, before: int, sweep: int) -> None:
        """Begin and end the faults of the network, and send the signals that are due."""
        named = {e.change.name for e in self._pair if e.begin <= sweep < e.end} & NETWORK.keys()
        self._faulty.fault = next((f for f in FAULTS if f.name in named), NO_FAULT)
        for episode in self._pair:
            if before < episode.begin <= sweep and isinstance(episode.change, OtherFault):
                for number in episode.change.signals:
                    self._hang_up(number)

    def _send_poses(self, to: socket.socket, pair: Sequence[Frame], begin_s: float) -> None:
        """Send the poses between two sweeps."""
        for before, after in pairwise(pair):
            for k in range(POSES_PER_SWEEP):
                share = k / POSES_PER_SWEEP
                T = before.T_world_sensor if share < 0.5 else after.T_world_sensor
                assert before.T_world_sensor is not None
                assert after.T_world_sensor is not None
                assert T is not None
                pose = T.copy()
                pose[:3, 3] = (1 - share) * before.T_world_sensor[:3, 3] + share * after.T_world_sensor[:3, 3]
                message = {"stamp": begin_s + share * PERIOD_S, "pose": pose[:3].ravel().tolist()}
                _send(to, json.dumps(message).encode())


def _stamped(payload: bytes, at_s: float) -> bytes:
    stamps = VelodyneStamps()
    return stamps.stamped(payload, round(1e6 * at_s) % stamps.wrap_us)


def _send(to: socket.socket, payload: bytes) -> None:
    try:
        to.send(payload)
    except ConnectionRefusedError:  # nobody listens yet
        return


def free_ports(number: int) -> tuple[int, ...]:
    """UDP ports of this machine that nobody uses."""
    bound = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(number)]
    for one in bound:
        one.bind(("127.0.0.1", 0))
    ports = tuple(int(one.getsockname()[1]) for one in bound)
    for one in bound:
        one.close()
    return ports


def status_of(folder: Path) -> dict[str, Any]:
    """The status of a run; empty before the first."""
    try:
        content: dict[str, Any] = json.loads((folder / "status.json").read_bytes())
    except (OSError, ValueError):
        return {}
    return content


def started(folder: Path) -> bool:
    """Whether a run has frames."""
    return bool(status_of(folder).get("counts", {}).get("frames"))


def tried(frames: Sequence[Frame], pair: Sequence[Episode]) -> list[str] | None:
    """Requirements that a live run with a pair of faults breaks; None if late packets make it worthless."""
    with tempfile.TemporaryDirectory(prefix="modt-pairs-") as name:
        folder = Path(name) / "run"
        packets, poses = free_ports(2)
        command = ["-m", "modt", "run", f"velodyne://127.0.0.1:{packets}", "--profile", SENSOR, "--core", "none"]
        command += ["--odometry", f"udp://127.0.0.1:{poses}", "--out", str(folder)]
        with (Path(name) / "log").open("wb") as log:
            run = subprocess.Popen([sys.executable, *command], stdout=log, stderr=log)
        sender = Sender(
            frames, pair, (packets, poses), lambda number: os.kill(run.pid, number), lambda: started(folder)
        )
        try:
            sender.run()
            if run.poll() is not None:
                return [f"the run ended with {run.returncode}"]
            run.send_signal(signal.SIGTERM)
            run.wait(ENDED_S)
        except subprocess.TimeoutExpired:
            return None if sender.too_late else ["the run did not end"]
        finally:
            if run.poll() is None:
                run.kill()
                run.wait()
        if sender.too_late:
            return None
        broken = [] if run.returncode == 0 else [f"the run ended with {run.returncode}"]
        return [*broken, *judged(folder, pair, sender.began_s)]


def judged(folder: Path, pair: Sequence[Episode], began_s: float) -> Iterator[str]:
    """Faults of a pair that were silent in the records of a run, and records that are missing."""
    lines = [json.loads(line) for line in (folder / "tracks.jsonl").read_text().splitlines()]
    status = status_of(folder)
    fates = dict(status["recording"]["fates"])
    if fates.pop("written") != len(lines):
        yield f"{len(lines)} frames are recorded, and others counted"
    if missing := status["counts"]["frames"] - len(lines) - sum(fates.values()):
        yield f"{missing} frames are neither recorded nor counted as lost"
    if lost := {fate: n for fate, n in fates.items() if n}:
        yield f"frames are lost: {lost}"
    yield from _of_sweeps(status, json.loads((folder / "summary.json").read_bytes())["faults"]["skipped"])
    sweep = (np.array([line["stamp_s"] for line in lines]) - began_s) / PERIOD_S
    good = np.array([line["trust"]["level"] == "good" for line in lines])
    for episode in pair:
        change = episode.change
        if isinstance(change, OtherFault):
            if not change.counted(status):
                yield f"{change.name}: not counted"
            continue
        late = (sweep > seen_from(episode, pair) + change.limit_s / PERIOD_S + 1) & (sweep < episode.end - 1)
        if (good & late).any():
            yield f"{change.name}: good in {np.count_nonzero(good & late)} of {np.count_nonzero(late)} frames"


def _of_sweeps(status: dict[str, Any], skipped: int) -> Iterator[str]:
    """Sweeps that are neither frames nor counted as left out."""
    sensor = status["sensor"]
    failed = sum(n for kind, n in status["loop"]["failures"].items() if kind.startswith(("frame:", "source:")))
    left_out = sensor["dropped_sweeps"] + status["loop"]["shed_sweeps"] + skipped + failed
    if missing := sensor["sweeps"] - status["counts"]["frames"] - left_out:
        yield f"{missing} sweeps are neither frames nor counted as left out"


def _tried_number(frames: Sequence[Frame], seed: int, number: int) -> list[str] | None:
    """A pair by its number, as faults hold functions, which no process hands on."""
    rng = np.random.default_rng(seed)
    pairs = [drawn(rng) for _ in range(number + 1)]
    return tried(frames, pairs[number])


def main() -> None:
    options = pair_options(__doc__)
    options.add_argument("--parallel", type=int, default=1, help="runs at once (default: %(default)s)")
    options.add_argument("--out", type=Path, default=Path("runs/pairs.jsonl"), help="results, one line a pair")
    given = options.parse_args()
    frames = list(SyntheticStream(given.scene, SENSOR, SECONDS, given.seed))
    given.out.parent.mkdir(parents=True, exist_ok=True)
    known = [json.loads(line) for line in given.out.read_text().splitlines()] if given.out.exists() else []
    done = {result["pair"] for result in known}
    rng = np.random.default_rng(given.seed)
    pairs = [drawn(rng) for _ in range(given.pairs)]

    numbers = [k for k in range(given.pairs) if k not in done]
    with ProcessPoolExecutor(given.parallel) as pool, given.out.open("a", encoding="utf-8") as out:
        results = pool.map(partial(_tried_number, frames, given.seed), numbers)
        for number, broken in zip(numbers, results, strict=True):
            names = " and ".join(f"{e.change.name} ({e.begin} to {e.end})" for e in pairs[number])
            if broken is None:
                print(f"{names}: not counted, as the machine was too busy", flush=True)
                continue
            known.append({"pair": number, "faults": names, "broken": broken})
            print(json.dumps(known[-1]), file=out, flush=True)
            if broken:
                print(f"{names}: {'; '.join(broken)}", flush=True)
    failed = sum(bool(result["broken"]) for result in known)
    print(f"{len(known)} pairs over live runs, {failed} with a broken promise")
    sys.exit(bool(failed))


if __name__ == "__main__":
    main()
