"""The sink view://, the live page of a run."""

from __future__ import annotations

import logging
from typing import Any

from modt.address import Address
from modt.energy import ledger, windows
from modt.errors import MisuseError
from modt.types import FrameResult
from modt.viewer.html_page import LIVE, content, page
from modt.viewer.live_frame import STEP_CM, live_message
from modt.viewer.live_server import LiveServer

log = logging.getLogger(__name__)

PORT = 8766
LOCAL = "127.0.0.1"


class LivePage:
    """Publishes each frame with its cost to the open pages, once its line of the ledger arrives."""

    def __init__(self, host: str, port: int) -> None:
        head, tail = page("modt", "waits for a sweep", content([], None, STEP_CM), LIVE)
        self._server = LiveServer(host, port, (head + tail).encode())
        self.port = int(self._server.server_address[1])
        self._result: FrameResult | None = None
        self._energy: dict[str, Any] = {}

    def write(self, result: FrameResult, /) -> None:
        """Keep a frame until its line of the ledger arrives."""
        self._result = result if self._server.watched else None

    def ledger(self, record: dict[str, Any], /) -> None:
        """Take the line of a frame, or the energy of the frames of a window."""
        if record["schema"] == windows.SCHEMA:
            n = record["frames"][2]
            if n and record["energy_J"] is not None:
                self._energy = {"energy_mJ": 1e3 * record["energy_J"] / n, "kind": record["kind"]}
        elif record["schema"] == ledger.SCHEMA and self._result is not None:
            result, self._result = self._result, None
            if result.frame.index == record["frame"]:
                cpu_ms = {name: round(1e-6 * stage["cpu_ns"], 3) for name, stage in record["stages"].items()}
                self._server.publish(live_message(result, {"cpu_ms": cpu_ms, **self._energy}))

    def close(self) -> None:
        """Close the page."""
        self._server.close()


def open_view(address: Address) -> LivePage:
    """Open the live page, by default at 127.0.0.1, which no other machine reaches.

    Raises:
        MisuseError: it cannot be bound.
    """
    host = address.host or LOCAL
    try:
        opened = LivePage(host, PORT if address.port is None else address.port)
    except OSError as error:
        remedy = "give a host of this machine and a free port, view://HOST:PORT"
        raise MisuseError(address.text, f"cannot be bound ({error.strerror or error})", remedy) from None
    log.warning("the run is shown at http://%s:%d/", f"[{host}]" if ":" in host else host, opened.port)
    return opened
