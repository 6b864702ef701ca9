"""Choice of a meter by its name."""

from __future__ import annotations

from modt.energy.meters.discovery import Discovery
from modt.energy.meters.meter import Candidate
from modt.errors import MisuseError


def choose_meter(found: Discovery, name: str | None) -> Candidate:
    """The best, or the first usable one whose name contains the text.

    Raises:
        MisuseError: none does, or it is not usable.
    """
    if name is None:
        return found.best
    named = [c for c in found.candidates if name.lower() in c.name.lower()]  # usable ones come first
    if named and named[0].usable:
        return named[0]
    if named:
        raise MisuseError(f"meter {named[0].name}", named[0].why_not, named[0].remedy)
    names = ", ".join(c.name for c in found.candidates if c.usable)
    raise MisuseError(f"meter {name}", "not on this machine", f"use one of: {names}")
