"""All targets."""

from tests.fuzz import files, live, results, runs, streams  # noqa: F401
from tests.fuzz.target import TARGETS

__all__ = ["TARGETS"]
