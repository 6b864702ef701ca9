"""Checks of the machine before the first frame. Each finding is one line with its remedy."""

from __future__ import annotations

import ctypes
import os
import shutil
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from modt import host
from modt.config import ClassificationConfig, ProfileConfig, SensorConfig
from modt.energy.meters.discovery import Discovery
from modt.energy.meters.meter import Kind
from modt.errors import ModtError
from modt.sources.live.joint_live import JointLive
from modt.sources.live.live_stream import LiveStream
from modt.sources.stream import StreamEndedError
from modt.trust.first_sweeps import doubts
from modt.types import Float32

OK = "ok"
WARN = "warn"
FAIL = "fail"
SWEEPS = 3
"""Number of sweeps in which the view is judged."""
REACH_S = 2.0
"""Time in which a sensor has to send a sweep [s]."""
COMPILE = "install modt from a wheel for this machine, or where a C compiler is"
_TIME_ERROR = 5
"""State of adjtimex(2) in which the clock is not synchronised."""
_SANE_YEAR = 2024
"""An earlier year means that the clock has lost its battery."""


@dataclass(frozen=True)
class Finding:
    """The outcome of a check: ok, warn (works, less well) or fail (does not work)."""

    level: str
    subject: str
    what: str
    remedy: str = ""

    def __str__(self) -> str:
        return f"{self.level:<4}  {self.subject}: {self.what}" + (f"; {self.remedy}" if self.remedy else "")


def core(number: int | None, sys: Path = Path("/sys")) -> Finding:
    """Check that the core of the loop is kept free of other work."""
    if number is None:
        return Finding(WARN, "core", "the loop is not pinned to a core", "leave out --core none")
    isolated = host.core_list(host.content(sys / "devices/system/cpu/isolated"))
    if number in isolated:
        return Finding(OK, "core", f"{number}, isolated")
    remedy = (
        f"give --core {' or '.join(map(str, sorted(isolated)))}, isolated by the kernel, if nothing else runs there"
    )
    if not isolated:
        remedy = f"add isolcpus={number} to the kernel's command line, and give --core {number} from then on"
    return Finding(WARN, "core", f"{number} is shared with other processes", remedy)


def governor(number: int | None, sys: Path = Path("/sys")) -> Finding:
    """Check that the clock frequency of the core is fixed."""
    path = sys / f"devices/system/cpu/cpu{number or 0}/cpufreq/scaling_governor"
    name = host.content(path).strip()
    if name in ("performance", ""):
        return Finding(OK, "governor", name or "none here: the clock is not controlled by this system")
    return Finding(WARN, "governor", f"{name}: frames begin on a slow clock", "cpupower frequency-set -g performance")


def permissions() -> list[Finding]:
    """Check real-time priority and locked memory, and use what is permitted."""
    refusals = host.take_real_time_priority()
    with ThreadPoolExecutor(1) as receiving:
        refusals.append(receiving.submit(host.serve_loop, None).result())
    findings = [Finding(WARN, "permissions", *refusal.split("; ", 1)) for refusal in refusals if refusal]
    return findings or [Finding(OK, "permissions", "SCHED_FIFO, memory locked")]


def meters(found: Discovery) -> Finding:
    """Check that energy is measured."""
    best = found.best
    facts = best.facts
    if facts is not None and facts.kind is not Kind.ESTIMATED:
        return Finding(OK, "meters", f"{best.name}, {facts.kind}")
    denied = next((c for c in found.candidates if c.meters and not c.usable), None)
    known = "no meter" if denied is None else f"{denied.name}: {denied.why_not}"
    remedy = "state idle_W and busy_W of the board" if denied is None else denied.remedy
    return Finding(WARN, "meters", f"energy is estimated ({known})", remedy)


def kernels(choose: Callable[[], str]) -> Finding:
    """Check that segmentation runs on compiled kernels."""
    try:
        name = choose()
    except ModtError as error:
        return Finding(FAIL, error.subject, error.cause, error.remedy)
    if name == "numpy":
        return Finding(WARN, "kernels", "NumPy: a frame takes about half as long again", COMPILE)
    return Finding(OK, "kernels", name)


def model(config: ClassificationConfig, load: Callable[[], dict[str, str]]) -> Finding:
    """Check that the network is the one that its card describes."""
    try:
        facts = load()
    except ModtError as error:
        return Finding(FAIL, "model", f"{error.subject}: {error.cause}", error.remedy)
    return Finding(OK, "model", f"{config.model}, SHA-256 {facts['sha256'][:12]} as on its card")


def near(sensor: SensorConfig) -> Finding:
    """Check that half of a person is in view from 1.1 m on."""
    seen_m = sensor.person_seen_from_m
    if seen_m is None:
        return Finding(OK, "near", "how much is seen of people is not known", "set height_m, elevation_span_deg")
    what = f"half of a person is in view from {seen_m:.1f} m on; nearer ones may be 'unknown, near'"
    return Finding(OK if seen_m <= 1.1 else WARN, "near", what, "beams that spread wider show more")


def disk(out: Path, config: ProfileConfig, free_bytes: Callable[[Path], int] | None = None) -> Finding:
    """Check that the disk has room for the records."""
    place = next(path for path in (out, *out.absolute().parents) if path.exists())
    if not os.access(place, os.W_OK):
        return Finding(FAIL, "disk", f"{place} cannot be written", "give another --out, or its owner the right")
    free_mb = 1e-6 * (free_bytes(place) if free_bytes else shutil.disk_usage(place).free)
    wanted_mb = 0.0 if config.recording.keep == "none" else config.recording.disk_mb
    if free_mb < wanted_mb:
        what = f"{free_mb:.0f} MB free at {place}, less than recording.disk_mb ({wanted_mb:.0f})"
        return Finding(WARN, "disk", what, "free it, or lower recording.disk_mb: recording pauses on a full disk")
    return Finding(OK, "disk", f"{free_mb:.0f} MB free, at most {wanted_mb:.0f} are used")


def clock(state: int | None = None, now_s: float | None = None) -> Finding:
    """Check that the calendar clock is set. Poses and sweeps are matched by it."""
    year = time.gmtime(time.time() if now_s is None else now_s).tm_year
    if year < _SANE_YEAR:
        return Finding(FAIL, "clock", f"the year is {year}", "set it, or fit a battery to the clock")
    state = int(ctypes.CDLL(None).adjtimex(ctypes.create_string_buffer(512))) if state is None else state
    if state == _TIME_ERROR:
        remedy = "start chrony or systemd-timesyncd, or have sensor and odometry stamp by one clock"
        return Finding(WARN, "clock", "not synchronised", remedy)
    return Finding(OK, "clock", "synchronised")


def sensor(
    open_source: Callable[[], LiveStream | JointLive], timeout_s: float = REACH_S, config: ProfileConfig | None = None
) -> list[Finding]:
    """Check that a source can be opened and sends sweeps; with a profile, that its sweeps are whole."""
    try:
        stream = open_source()
    except ModtError as error:
        return [Finding(FAIL, "sensor", f"{error.subject}: {error.cause}", error.remedy)]
    stream.start()
    end_s = time.monotonic() + timeout_s
    sweeps: list[Float32] = []
    try:
        while len(sweeps) < (1 if config is None else SWEEPS) and time.monotonic() < end_s:
            received = stream.take(max(end_s - time.monotonic(), 0.0))
            sweeps += [] if received is None else [received.frame.points]
        health = stream.health()
    except StreamEndedError:
        health = stream.health()
    except Exception as error:
        return [Finding(FAIL, "sensor", f"{stream.info.name}: {error}", "check its address")]
    finally:
        stream.close()
    found = [_sensor_finding(stream.info.name, health, len(sweeps[0]) if sweeps else None)]
    if config is not None and sweeps:
        of_view = doubts(sweeps, config.sensor)
        found += [Finding(FAIL if useless else WARN, "view", what, remedy) for useless, what, remedy in of_view]
    return found


def _sensor_finding(name: str, health: dict[str, Any], points: int | None) -> Finding:
    """The finding of a sensor, by the points of its first sweep, None without one."""
    if points is not None:
        return Finding(OK, "sensor", f"{name}: a sweep of {points} points")
    messages = health["messages"]
    refused = health["refused_messages"]
    if health["silence"]:
        return Finding(FAIL, "sensor", f"{name}: nothing received in {REACH_S:g} s", health["silence"])
    if refused:
        remedy = "give the address of the sensor that sends here"
        return Finding(FAIL, "sensor", f"{name}: only unusable messages ({', '.join(refused)})", remedy)
    if messages:
        return Finding(FAIL, "sensor", f"{name}: {messages} messages, but no sweep", "is its rate below 0.5 Hz?")
    remedy = "check its power, cable, address and port, and the firewall"
    return Finding(FAIL, "sensor", f"{name}: nothing received in {REACH_S:g} s", remedy)
