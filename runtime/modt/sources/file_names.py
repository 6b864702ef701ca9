"""Order and times of files from their names."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from datetime import datetime
from pathlib import Path

_SINCE_1970 = re.compile(r"(?<![0-9])([1-9][0-9]{9})([._-]?)([0-9]*)")
_CALENDAR = re.compile(
    r"(?<![0-9])(19[7-9][0-9]|20[0-9]{2})[-_.]?([0-9]{2})[-_.]?([0-9]{2})[T _-]?"  # date
    r"([0-9]{2})[-:_.]?([0-9]{2})[-:_.]?([0-9]{2})([.,_-]?)([0-9]*)"
)
_SECONDS = re.compile(r"([0-9]{1,9})(\.)([0-9]+)")

MAX_NS = 1e19
"""A greater number is no time in any unit [ns]."""
UNITS_NS = (1e11, 10**9), (1e14, 10**6), (1e17, 10**3)
"""Numbers below which a time is in seconds, milliseconds, microseconds, and the length of the unit [ns]."""


def files_in(folder: Path, suffix: str) -> list[Path]:
    """Regular files with a suffix in a folder, ordered by the times in their names, else by the numbers."""
    files = [f for f in folder.glob(f"*{suffix}") if f.is_file() and not f.name.startswith(".")]
    files.sort(key=lambda f: [int(part) if k % 2 else part for k, part in enumerate(re.split("([0-9]+)", f.stem))])
    times = times_ns([f.stem for f in files])
    return files if times is None else [f for _, f in sorted(zip(times, files, strict=True))]


def times_ns(names: Sequence[str]) -> list[int] | None:
    """Times in names [ns]; None if a name has no time, or two names have the same.

    A time is a date and time of day, or seconds since 1970. A name that is a number with a fraction may count its
    seconds from any moment.
    """
    for find in (_date, _time, _since_1970):  # a date may be that of the log, the same in all names
        if (times := _distinct([time for name in names if (time := find(name)) is not None], len(names))) is not None:
            return times
    return None


def _distinct(known: Sequence[tuple[int, str, str]], n: int) -> list[int] | None:
    """Times [ns] of n names; None if some have none, or two the same."""
    if not n or len(known) < n:
        return None
    longest = max(len(fraction) for _, _, fraction in known)
    uneven = any(len(fraction) < longest for _, _, fraction in known)
    counted = uneven and (longest > 7 or known[0][1] != ".")  # without leading zeros; else without trailing ones
    wide = longest if counted else 0
    times = [second * 10**9 + int(f.rjust(wide, "0").ljust(9, "0")) for second, _, f in known]
    return times if len(set(times)) == len(times) else None


def time_ns(text: str) -> int | None:
    """Time in a text [ns], None without one."""
    time = _time(text.strip())
    return None if time is None else time[0] * 10**9 + int(time[2].ljust(9, "0"))


def seconds_ns(text: str) -> int | None:
    """Time of a number in seconds [ns]; greater numbers are milli-, micro- or nanoseconds since 1970."""
    try:
        time = float(text)
    except ValueError:
        return None
    if not abs(time) < MAX_NS:
        return None
    unit_ns = next((unit for most, unit in UNITS_NS if abs(time) < most), 1)
    return round(time * unit_ns)


def _time(name: str) -> tuple[int, str, str] | None:
    """Second, separator and digits of the fraction of a second."""
    return _date(name) or _since_1970(name)


def _date(name: str) -> tuple[int, str, str] | None:
    """Those of a date and time of day."""
    if match := _CALENDAR.search(name):
        with suppress(ValueError):
            second = datetime.strptime("".join(match.groups()[:6]) + "+0000", "%Y%m%d%H%M%S%z").timestamp()
            return int(second), match[7], match[8][:9]
    return None


def _since_1970(name: str) -> tuple[int, str, str] | None:
    """Those of a number of seconds, with the digits of its fraction."""
    match = _SINCE_1970.search(name)
    if match is None or not (match[2] or len(match[3]) in (0, 3, 6, 9)):
        match = _SECONDS.fullmatch(name)
    return None if match is None else (int(match[1]), match[2], match[3][:9])
