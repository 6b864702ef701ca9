"""Control of a Chromium without a window, by its DevTools protocol."""

import json
import os
import shutil
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from tempfile import TemporaryDirectory
from typing import Any

NAMES = "chromium", "chromium-browser", "google-chrome", "google-chrome-stable"
WAIT_S = 120.0
"""Time after which a page is taken to hang, on however busy a machine [s]."""
OPTIONS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--hide-scrollbars",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-extensions",
    "--remote-debugging-pipe",
)


def find() -> str | None:
    """Path of an installed Chromium or Chrome, or None."""
    return next(filter(None, map(shutil.which, NAMES)), None)


class Browser:
    """A browser at the other end of a socket."""

    def __init__(self, commands: socket.socket) -> None:
        self._socket = commands
        self._buffer = b""
        self._number = 0
        self._socket.settimeout(WAIT_S)
        self.events: list[dict[str, Any]] = []

    def call(self, method: str, session: str | None = None, **params: Any) -> dict[str, Any]:
        """Send a command and return its result. Events that come before it are kept."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": params} | (
            {"sessionId": session} if session else {}
        )
        self._socket.sendall(json.dumps(message).encode() + b"\0")
        while True:
            answer = self._message()
            if answer.get("id") != self._number:
                self.events.append(answer)
            elif "error" in answer:
                raise RuntimeError(f"{method}: {answer['error']}")
            else:
                return dict(answer["result"])

    def _message(self) -> dict[str, Any]:
        while b"\0" not in self._buffer:
            part = self._socket.recv(1 << 20)
            if not part:
                raise RuntimeError("the browser has ended")
            self._buffer += part
        text, _, self._buffer = self._buffer.partition(b"\0")
        return dict(json.loads(text))


class Tab:
    """A page in a browser."""

    def __init__(self, browser: Browser, url: str, width: int, height: int, *, dark: bool, first: str = "") -> None:
        self._browser = browser
        self._target = browser.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = browser.call("Target.attachToTarget", targetId=self._target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self.call(f"{domain}.enable")
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])
        if first:
            self.call("Page.addScriptToEvaluateOnNewDocument", source=first)
        self.call("Page.navigate", url=url)

    def call(self, method: str, **params: Any) -> dict[str, Any]:
        """Send a command to the page and return its result."""
        return self._browser.call(method, self._session, **params)

    def value(self, expression: str) -> Any:
        """Value of an expression or of its promise."""
        found = self.call("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in found:
            raise RuntimeError(found["exceptionDetails"]["exception"].get("description", "it throws"))
        return found["result"].get("value")

    def until(self, condition: str) -> None:
        """Wait for a condition."""
        end_s = time.monotonic() + WAIT_S
        while not self.value(f"(() => {{ try {{ return Boolean({condition}) }} catch {{ return false }} }})()"):
            if time.monotonic() > end_s:
                raise TimeoutError(f"{condition} does not hold in time; {self.failures()}")
            time.sleep(0.02)

    def failures(self) -> list[str]:
        """Errors and warnings of the page's console so far, and its uncaught exceptions."""
        self.value("0")  # receives the events so far
        found = []
        for event in self._browser.events:
            method = event.get("method")
            params = event.get("params", {})
            if event.get("sessionId") != self._session:
                continue
            if method == "Runtime.exceptionThrown":
                found.append(json.dumps(params["exceptionDetails"]))
            elif method == "Runtime.consoleAPICalled" and params["type"] in ("error", "warning"):
                found.append(json.dumps(params["args"]))
            elif method == "Log.entryAdded" and params["entry"]["level"] in ("error", "warning"):
                found.append(f"{params['entry']['text']} {params['entry'].get('url', '')}")
        return found

    def point(self, x: float, y: float) -> None:
        """Move the mouse to a place [CSS pixels]."""
        self.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)

    def press(self, key: str) -> None:
        """Press and release a key, named as in JavaScript."""
        text = {"text": key} if len(key) == 1 else {}
        self.call("Input.dispatchKeyEvent", type="keyDown", key=key, **text)
        self.call("Input.dispatchKeyEvent", type="keyUp", key=key)

    def close(self) -> None:
        """Close the page."""
        self._browser.call("Target.closeTarget", targetId=self._target)


@contextmanager
def browser(path: str) -> Iterator[Browser]:
    """Start a browser, and end it on leaving the context."""
    ours, theirs = socket.socketpair()
    with (
        TemporaryDirectory(prefix="browser-", ignore_cleanup_errors=True) as profile,
        open(os.devnull, "w") as null,
        ours,
    ):
        # It reads commands at descriptor 3, and answers at 4.
        ends = [(null.fileno(), 1), (null.fileno(), 2), (theirs.fileno(), 3), (theirs.fileno(), 4)]
        command = [path, *OPTIONS, f"--user-data-dir={profile}", "about:blank"]
        pid = os.posix_spawn(
            path, command, os.environ, file_actions=[(os.POSIX_SPAWN_DUP2, own, fd) for own, fd in ends]
        )
        theirs.close()
        started = Browser(ours)
        try:
            yield started
        finally:
            with suppress(Exception):
                started.call("Browser.close")
            os.waitpid(pid, 0)
