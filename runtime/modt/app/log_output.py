"""The log of a service, written by a thread, so that the loop never waits for whoever reads it."""

from __future__ import annotations

import logging

from modt.app.failures import OncePerSecond
from modt.sinks.background import Background
from modt.sinks.frame_lines import Descriptor

STANDARD_ERROR = 2
DEPTH = 256
"""Lines that may wait for a reader that stalls. Then the oldest are dropped, and counted."""


class LogOutput(logging.Handler):
    """Takes the place of the handlers of the root logger until it is closed."""

    def __init__(self) -> None:
        super().__init__()
        root = logging.getLogger()
        self._before = root.handlers[:]
        root.handlers[:] = [self]
        self.writer: Background[str] = Background("log", Descriptor(STANDARD_ERROR), DEPTH)
        self.setFormatter(logging.Formatter("modt: %(message)s"))
        self.addFilter(OncePerSecond())

    def emit(self, record: logging.LogRecord) -> None:
        """Hand over a line."""
        self.say(self.format(record))

    def say(self, text: str) -> None:
        """Hand over a text as a line."""
        self.writer.write(f"{text}\n")

    def close(self) -> None:
        """Write what waits, within the time limit of the writer."""
        self.writer.close()  # what it says of its own end goes nowhere, instead of to a reader that stalls
        logging.getLogger().handlers[:] = self._before
        super().close()
