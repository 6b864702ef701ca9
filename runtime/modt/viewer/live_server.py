"""HTTP server of a page and its events. A slow client misses events, and the run never waits."""

from __future__ import annotations

import socket
import threading
from contextlib import suppress
from http.server import BaseHTTPRequestHandler
from ipaddress import ip_address
from socketserver import ThreadingTCPServer

_Request = socket.socket | tuple[bytes, socket.socket]

MOST_PAGES = 8
"""Greatest number of pages that receive events."""
MOST_CONNECTIONS = 32
"""Greatest number of connections, each with its thread."""
SEND_S = 5.0
"""A client that takes nothing for so long is disconnected [s]."""
POLL_S = 0.1
"""Interval between two checks for the end of the server [s]."""
ALIVE_S = 10.0
"""Longest time without an event before a comment keeps a connection open [s]."""


class LiveServer(ThreadingTCPServer):
    """Serves a page at /, events at /events, and metrics at /metrics, in threads of its own.

    Attributes:
        page: HTML.
        metrics: text for Prometheus; empty before the first status.
        port: port that is bound.
        names: host names that a request may use, or None for all. On the loopback they are limited, because a page of
            another site could reach it by a name of its own.

    Raises:
        OSError: the address cannot be bound.
    """

    daemon_threads = True
    allow_reuse_address = True

    def __init__(self, host: str, port: int, page: bytes) -> None:
        self.page = page
        self.metrics = b""
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        self.address_family = family
        super().__init__((str(address[0]), int(address[1])), _Handler)
        self.port = int(self.server_address[1])
        local = ip_address(str(address[0])).is_loopback
        self.names = {"localhost", "127.0.0.1", "[::1]", host} if local else None
        self._free = threading.Semaphore(MOST_CONNECTIONS)
        # The fields below are guarded by `_changed`.
        self._changed = threading.Condition()
        self._event = b""
        self._number = 0  # of the event
        self._pages = 0
        self._closed = False
        threading.Thread(target=self.serve_forever, args=(POLL_S,), name="view", daemon=True).start()

    @property
    def watched(self) -> bool:
        """Whether a page is open."""
        return self._pages > 0

    def publish(self, data: str) -> None:
        """Replace the event, which every page receives as soon as it has sent the one before."""
        with self._changed:
            self._event = f"data: {data.rstrip()}\n\n".encode()
            self._number += 1
            self._changed.notify_all()

    def enter(self) -> int | None:
        """Count a page, and return the number of the last event before it, or None if there are too many."""
        with self._changed:
            if self._pages >= MOST_PAGES:
                return None
            self._pages += 1
            return self._number

    def leave(self) -> None:
        """Release the place of a page."""
        with self._changed:
            self._pages -= 1

    def event_after(self, number: int) -> tuple[int, bytes] | None:
        """Wait for an event newer than a number, and return the newest with its own number, or None at the end.

        After ALIVE_S without an event it is a comment.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._closed or self._number > number, ALIVE_S)
            if self._closed:
                return None
            return self._number, self._event if self._number > number else b": alive\n\n"

    def close(self) -> None:
        """Stop the server and disconnect the pages."""
        self.shutdown()
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        self.server_close()

    def verify_request(self, request: object, client_address: object) -> bool:
        """Whether there is room for another connection, which is closed if there is none."""
        return self._free.acquire(blocking=False)

    def process_request_thread(self, request: _Request, client_address: object) -> None:
        """Answer a request, and release its place."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: object, client_address: object) -> None:
        """Ignore the error, since the client has gone."""


class _Handler(BaseHTTPRequestHandler):
    server: LiveServer
    timeout = SEND_S

    def handle(self) -> None:
        """Answer a request. A client whose request takes longer than SEND_S is disconnected."""
        self.late = threading.Timer(SEND_S, self._leave)
        self.late.start()
        try:
            super().handle()
        finally:
            self.late.cancel()

    def _leave(self) -> None:
        with suppress(OSError):
            self.connection.shutdown(socket.SHUT_RDWR)

    def do_GET(self) -> None:
        """Answer with the page or the events. Requests under another host name are refused."""
        self.late.cancel()
        name = self.headers.get("Host", "").rpartition(":")[0] or self.headers.get("Host", "")
        if self.server.names is not None and name not in self.server.names:
            self.send_error(403, "another host")
        elif self.path == "/":
            self._head("text/html; charset=utf-8")
            self.wfile.write(self.server.page)
        elif self.path == "/metrics":
            self._head("text/plain; version=0.0.4; charset=utf-8")
            self.wfile.write(self.server.metrics)
        elif self.path == "/events":
            self._events()
        elif self.path == "/favicon.ico":  # browsers ask for it by themselves
            self.send_response(204)
            self.end_headers()
        else:
            self.send_error(404)

    def _events(self) -> None:
        """Send events until the client leaves or the server ends."""
        number = self.server.enter()
        if number is None:
            self.send_error(503, "too many pages are open")
            return
        try:
            self._head("text/event-stream")
            while (event := self.server.event_after(number)) is not None:
                number, text = event
                self.wfile.write(text)
        except OSError:
            with suppress(OSError):
                self.connection.close()
        finally:
            self.server.leave()

    def _head(self, kind: str) -> None:
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Cache-Control", "no-store")
        self.end_headers()

    def log_message(self, format: str, *args: object) -> None:
        """Log nothing, because the log belongs to the run."""
