"""Errors a user can act on: one line that names the thing, the cause and the remedy."""


class ModtError(Exception):
    """Something failed for a reason that the user can see to; exit status 1.

    Args:
        subject: the file, key or device concerned.
        cause: what is wrong with it.
        remedy: what to do about it.
    """

    exit_status = 1

    def __init__(self, subject: object, cause: str, remedy: str) -> None:
        super().__init__(f"{subject}: {cause}; {remedy}")
        self.subject, self.cause, self.remedy = str(subject), cause, remedy


class MisuseError(ModtError):
    """The request itself cannot be met as it was made (a wrong path, key or option); exit status 2."""

    exit_status = 2


class ScanError(ModtError):
    """One scan cannot be used; the stream goes on without it."""
