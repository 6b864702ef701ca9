"""Errors with a remedy, each one line of subject, cause and remedy."""

from __future__ import annotations

from pathlib import Path


class ModtError(Exception):
    """A failure that the user can remedy; exit status 1.

    Args:
        subject: the file, key or device.
        cause: the fault.
        remedy: the action that removes it.
    """

    exit_status = 1

    def __init__(self, subject: object, cause: str, remedy: str) -> None:
        super().__init__(f"{subject}: {cause}; {remedy}")
        self.subject = str(subject)
        self.cause = cause
        self.remedy = remedy

    def __reduce__(self) -> tuple[type[ModtError], tuple[str, str, str]]:
        """Class and arguments, by which an error crosses from one process to another."""
        return type(self), (self.subject, self.cause, self.remedy)


class MisuseError(ModtError):
    """An invalid request (path, key or option); exit status 2."""

    exit_status = 2


class ScanError(ModtError):
    """A scan that cannot be used; the stream continues without it."""


def refuse_pipe(path: Path, remedy: str) -> None:
    """Raise a MisuseError where a path leads to a pipe or a device, which may never end, or to a folder."""
    if path.exists() and not path.is_file():
        raise MisuseError(path, "is no file", remedy)


def install(extra: str) -> str:
    """Remedy for a missing extra, from a clone of modt or from the file of its wheel."""
    return f"pip install '.[{extra}]' in a clone of modt, or 'FILE.whl[{extra}]' of its wheel"
