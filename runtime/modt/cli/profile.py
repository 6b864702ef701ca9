"""`modt-profile`: what it costs, what it saves, and how anybody can know."""

from __future__ import annotations

from collections.abc import Sequence

from modt.cli import profile_calibrate, profile_compare, profile_meters, profile_report
from modt.cli.command import dispatch

COMMANDS = (profile_meters, profile_calibrate, profile_report, profile_compare)


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; returns the exit status: 0 well, 1 failed, 2 misused, 130 interrupted."""
    return dispatch("modt-profile", "Accounts for the energy of modt.", COMMANDS, argv)


if __name__ == "__main__":
    raise SystemExit(main())
