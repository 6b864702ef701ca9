"""Containment of failures: each kind is counted and logged once. Only MAX_IN_A_ROW failures in a row end the run."""

from __future__ import annotations

import logging
import re
import time
from collections import Counter
from collections.abc import Callable
from typing import ParamSpec, TypeVar

from modt.errors import ModtError

P = ParamSpec("P")
R = TypeVar("R")
log = logging.getLogger(__name__)

MAX_IN_A_ROW = 10
"""Failures in a row that end the run."""
RENEW_AFTER = 5
"""Failures in a row after which new stages are made."""


class Failures:
    """Counts of contained exceptions by kind.

    Args:
        contained: whether exceptions are contained. If not, each one ends the run.

    Attributes:
        counts: number of exceptions by place and type.
        in_a_row: number of frames that failed since the last one that did not.
    """

    def __init__(self, *, contained: bool = True) -> None:
        self.counts: Counter[str] = Counter()
        self.in_a_row = 0
        self._contained = contained

    def succeed(self) -> None:
        """Note a frame without a failure."""
        self.in_a_row = 0

    def fail(self, error: Exception, where: str) -> None:
        """Count an exception of a frame.

        Raises:
            ModtError: it is the last of MAX_IN_A_ROW failures in a row.
        """
        self.in_a_row += 1
        self._count(error, where)
        if self.in_a_row >= MAX_IN_A_ROW:
            cause = f"{self.in_a_row} failures in a row, the last one {type(error).__name__}: {error}"
            raise ModtError(where, cause, "report it, with the traceback above") from error

    def contain(self, where: str, call: Callable[P, R], /, *arguments: P.args, **options: P.kwargs) -> R | None:
        """Result of a call that is not essential. A failure is counted, and the result is None."""
        try:
            return call(*arguments, **options)
        except Exception as error:
            self._count(error, where)
            return None

    def _count(self, error: Exception, where: str) -> None:
        """Count a failure, and log the first of its kind with its traceback."""
        if not self._contained:
            raise error
        kind = f"{where}: {type(error).__name__}"
        self.counts[kind] += 1
        if self.counts[kind] == 1:
            log.error("%s; later ones are only counted", kind, exc_info=error)


NUMBER = re.compile(r"(?<!\w)[0-9][0-9a-fA-F.:]*")
MAX_KINDS = 256
"""Kinds of lines that are told apart. Beyond, the one that came first is forgotten."""


class OncePerSecond(logging.Filter):
    """Passes one line a second of each kind of message, with the number of lines that were held back.

    Messages are of one kind if they differ by numbers alone, such as the port of a client. A digit of a name, as in
    lidar1, is no number.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._clock = clock
        # Time at which a line of a kind last passed, and number of lines held back since then
        self._passed: dict[str, tuple[float, int]] = {}

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether a line passes."""
        kind = NUMBER.sub("#", f"{record.name} {record.msg}")
        now_s = self._clock()
        passed_s, held = self._passed.get(kind, (float("-inf"), 0))
        if now_s - passed_s < 1.0:
            self._passed[kind] = (passed_s, held + 1)
            return False
        if kind not in self._passed and len(self._passed) == MAX_KINDS:
            del self._passed[next(iter(self._passed))]
        self._passed[kind] = (now_s, 0)
        record.msg = f"{record.msg} (and {held} lines like it)" if held else record.msg
        return True
