"""`modt-profile`: the command line of energy accounting."""

from __future__ import annotations

from collections.abc import Sequence

from modt.cli import profile_calibrate, profile_meters, profile_report
from modt_desk.cli import profile_compare, profile_predict
from modt.cli.command import dispatch

COMMANDS = (profile_meters, profile_calibrate, profile_report, profile_compare, profile_predict)


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; returns the exit status: 0 success, 1 failure, 2 misuse, 130 interrupted."""
    return dispatch("modt-profile", "Account for the energy of modt.", COMMANDS, argv)


if __name__ == "__main__":
    raise SystemExit(main())
