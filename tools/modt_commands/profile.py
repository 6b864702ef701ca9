"""`modt-profile`: the command line of energy accounting."""

from __future__ import annotations

from collections.abc import Sequence

from modt.cli.command import dispatch

COMMANDS = {
    "meters": "modt_commands.profile_meters",
    "calibrate": "modt_commands.profile_calibrate",
    "report": "modt_commands.profile_report",
    "compare": "modt_commands.profile_compare",
    "predict": "modt_commands.profile_predict",
}
"""Module of each command."""
WHAT = "Account for the energy of modt. For profiles of sensors and boards see `modt profile`."


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; returns the exit status: 0 success, 1 failure, 2 misuse, 130 interrupted."""
    return dispatch("modt-profile", WHAT, COMMANDS, argv)


if __name__ == "__main__":
    raise SystemExit(main())
