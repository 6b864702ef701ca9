"""A terminal that shows one page, and is left as it was."""

from __future__ import annotations

import os
import select
import signal
import sys
import termios
import tty
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from textwrap import wrap
from typing import TextIO

ENTER, LEAVE = "\x1b[?1049h\x1b[?25l", "\x1b[?25h\x1b[?1049l"
"""The other screen without a cursor, and back."""
HOME, END_OF_LINE, BELOW = "\x1b[H", "\x1b[K", "\x1b[J"
INDENT = 14 * " "
"""Of what continues a line: where its figures begin."""
UNKNOWN = 80, 24
"""Columns and rows of a terminal that states none, as serial lines and containers do."""
BOLD, PLAIN = "\x1b[1m", "\x1b[0m"


class Screen:
    """The page of a terminal, and its keys."""

    def __init__(self, keys: TextIO, page: TextIO) -> None:
        self._keys, self._page = keys, page

    def show(self, lines: Sequence[str]) -> None:
        """Replace the page; the first line is bold, long ones are broken, what has no room below is cut off."""
        size = os.get_terminal_size(self._page.fileno())
        columns, n_rows = size.columns or UNKNOWN[0], size.lines or UNKNOWN[1]
        rows = [row for line in lines for row in wrap(printable(line), columns, subsequent_indent=INDENT) or [""]]
        shown = f"{END_OF_LINE}{PLAIN}\r\n".join(rows[:n_rows])
        self._page.write(f"{HOME}{BOLD}{shown}{END_OF_LINE}{PLAIN}{BELOW}")
        self._page.flush()

    def key(self, timeout_s: float) -> str:
        """The next key, empty where none is pressed in time."""
        ready, _, _ = select.select([self._keys], [], [], timeout_s)
        return os.read(self._keys.fileno(), 1).decode("ascii", "replace") if ready else ""


@contextmanager
def full_screen(keys: TextIO, page: TextIO) -> Iterator[Screen]:
    """A terminal's other screen, keys read one by one; SIGTERM ends the process with the terminal restored."""
    mode = termios.tcgetattr(keys)
    handlers = {number: signal.signal(number, handler) for number, handler in _HANDLERS.items()}
    try:
        tty.setcbreak(keys)
        page.write(ENTER)
        yield Screen(keys, page)
    finally:
        page.write(LEAVE)
        page.flush()
        termios.tcsetattr(keys, termios.TCSADRAIN, mode)
        for number, handler in handlers.items():
            signal.signal(number, handler)


def printable(line: str) -> str:
    """The line without what would steer the terminal."""
    return "".join(character if character.isprintable() else "?" for character in line)


def _end(number: int, _frame: object) -> None:
    sys.exit(128 + number)


def _interrupt(number: int, _frame: object) -> None:
    raise KeyboardInterrupt


_HANDLERS: dict[int, Callable[[int, object], None] | signal.Handlers] = {
    signal.SIGINT: _interrupt,
    signal.SIGTERM: _end,
    signal.SIGTSTP: signal.SIG_IGN,
}
"""A suspended process would leave the other screen behind."""
