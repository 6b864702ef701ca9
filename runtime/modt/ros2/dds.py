"""Topics of ROS 2 over Cyclone DDS."""

from __future__ import annotations

import logging
import os
import threading
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any
from weakref import WeakValueDictionary

from modt.errors import MisuseError, ModtError, install
from modt.ros2.definitions import DEFINITIONS

try:
    from cyclonedds import idl
    from cyclonedds.core import DDSException, ReadCondition, WaitSet
    from cyclonedds.core import InstanceState as Instance
    from cyclonedds.core import SampleState as Sample
    from cyclonedds.core import ViewState as View
    from cyclonedds.domain import Domain, DomainParticipant
    from cyclonedds.pub import DataWriter
    from cyclonedds.qos import Policy, Qos
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic

except ImportError:
    raise MisuseError("ROS 2", "needs Cyclone DDS", f"{install('ros2')}, or build cyclonedds") from None

log = logging.getLogger(__name__)

BUFFER_BYTES = 16 << 20
"""Requested socket buffer [bytes]: a sweep arrives as a burst of up to 2 MB."""
CONFIGURATION = (
    '<CycloneDDS><Domain Id="any"><Internal>'
    f'<SocketReceiveBufferSize min="default" max="{BUFFER_BYTES}B"/>'
    "</Internal></Domain></CycloneDDS>"
)
RMEM_MAX = Path("/proc/sys/net/core/rmem_max")
ENOUGH_BYTES = 4 << 20
"""Value of rmem_max that suffices for a sweep of 120,000 points in Ethernet fragments [bytes]."""


@dataclass(frozen=True)
class Message:
    """A message as received, and the time of sending by the sender's clock [s]."""

    data: bytes
    sent_s: float


class Participant:
    """The process in a DDS domain. All topics share one participant, and so Cyclone's threads."""

    def __init__(self, domain_id: int) -> None:
        given = os.environ.get("CYCLONEDDS_URI")  # comes last and wins
        with suppress(DDSException):  # the program around this library has set up the domain
            self._domain = Domain(domain_id, f"{CONFIGURATION},{given}" if given else CONFIGURATION)
        try:
            self.entity = DomainParticipant(domain_id)
        except DDSException as error:
            remedy = "check the network interfaces and CYCLONEDDS_URI"
            raise ModtError(f"ROS 2 domain {domain_id}", f"cannot be joined ({error})", remedy) from None

    def topic(self, name: str, kind: str) -> Any:
        """The DDS topic of a ROS 2 topic and the type of its messages."""
        return Topic(self.entity, "rt/" + name.strip("/"), message_type(kind))


_participants: WeakValueDictionary[int, Participant] = WeakValueDictionary()
_lock = threading.Lock()


def participant(domain_id: int) -> Participant:
    """The participant of a domain, which is joined first. Its threads run on the cores of the caller.

    Raises:
        ModtError: the domain cannot be joined.
    """
    with _lock:
        found = _participants.get(domain_id)
        if found is None:
            _warn_of_buffer()
            found = Participant(domain_id)
            _participants[domain_id] = found
        return found


class Subscription:
    """The messages of a topic, the last `depth` of them; used by one thread."""

    def __init__(self, joined: Participant, name: str, kind: str, *, depth: int, reliable: bool = False) -> None:
        self._depth = depth
        self._reader = DataReader(joined.entity, joined.topic(name, kind), qos=_qos(depth, reliable))
        self._unread = ReadCondition(self._reader, View.Any | Instance.Any | Sample.NotRead)
        self._arrival = WaitSet(joined.entity)
        self._arrival.attach(self._unread)
        self._joined = joined

    @property
    def mismatch(self) -> str:
        """Why a sender's messages do not come, with the remedy; empty if none is known to send in vain."""
        status = getattr(self._reader, "get_requested_incompatible_qos_status", lambda: None)()
        if status is None or not status.total_count:
            return ""
        return "its sender offers another quality of service than is asked for: give ?reliability=best_effort"

    def take(self, timeout_s: float = 0.0) -> list[Message]:
        """The messages that have arrived, oldest first; waits at most `timeout_s` for one."""
        if timeout_s > 0:
            self._arrival.wait(int(timeout_s * 1e9))
        samples = self._reader.take(self._depth)
        return [
            Message(sample.message, 1e-9 * sample.sample_info.source_timestamp)
            for sample in samples
            if hasattr(sample, "message")  # a notice that a sender has left has none
        ]


class Publication:
    """Sends to a topic; never waits for a slow receiver."""

    def __init__(self, joined: Participant, name: str, kind: str, *, depth: int = 5) -> None:
        self._kind = message_type(kind)
        self._joined = joined
        self._writer = DataWriter(joined.entity, joined.topic(name, kind), qos=_qos(depth, reliable=True))

    def write(self, message: bytes) -> bool:
        """Send a message; False if DDS refused it."""
        try:
            self._writer.write(self._kind(message))
        except DDSException:
            return False
        return True

    @property
    def receivers(self) -> int:
        """Matched subscribers; 1 with version 0.10 of the binding (Humble, Jazzy), which does not count them."""
        matched = getattr(self._writer, "get_matched_subscriptions", None)
        return 1 if matched is None else len(matched())


def _qos(depth: int, reliable: bool) -> Any:
    reliability = Policy.Reliability.Reliable(0) if reliable else Policy.Reliability.BestEffort
    return Qos(
        reliability,
        Policy.History.KeepLast(depth),
        Policy.Durability.Volatile,
        Policy.DataRepresentation(use_cdrv0_representation=True),
    )


def _warn_of_buffer() -> None:
    try:
        granted = int(RMEM_MAX.read_text())
    except (OSError, ValueError):
        return
    if granted < ENOUGH_BYTES:
        cause = f"{granted} bytes are too few for a sweep that arrives at once"
        log.warning("net.core.rmem_max: %s; sysctl -w net.core.rmem_max=%d", cause, ENOUGH_BYTES)


TYPES: Any = idl.types
PRIMITIVES: dict[str, Any] = {"string": str, "bool": bool}


@cache
def message_type(name: str) -> type[Any]:
    """DDS type whose objects are made of the bytes of a message, and keep them as `message`.

    Cyclone DDS checks a message against its type in C, so the types are whole. Its deserialiser makes a Python object
    of every number; these types keep the bytes instead, which the other modules of this package read and write.
    """
    kind: type[Any] = _struct(name)

    def make(self: Any, message: bytes) -> None:
        self.message = message

    kind.__init__ = make
    kind.serialize = lambda self, *_, **__: self.message
    kind.deserialize = classmethod(lambda cls, message, *_, **__: cls(message))
    kind.deserialize_key = classmethod(lambda _cls, *_, **__: None)  # for the notice that a sender has left
    return kind


@cache
def _struct(name: str) -> Any:
    package, _, short = name.partition("/")
    fields = (field.split() for field in DEFINITIONS[name].split(", "))
    made = {field: _type(kind) for kind, field in fields}
    return idl.make_idl_struct(short, f"{package}::msg::dds_::{short}_", made)


def _type(kind: str) -> Any:
    element, bracket, size = kind.rstrip("]").partition("[")
    single = _struct(element) if "/" in element else PRIMITIVES.get(element) or getattr(TYPES, element)
    if not bracket:
        return single
    return TYPES.array[single, int(size)] if size else TYPES.sequence[single]
