"""Limits of one input."""

from __future__ import annotations

import time

import pytest

from tests.fuzz import execution
from tests.fuzz.execution import execute, limits


def spin(_: bytes) -> None:
    while True:
        pass


@pytest.mark.parametrize(
    ("limit", "call", "error"),
    [
        ("CPU_TIME_S", spin, "DeadlineError: longer than 0.05 s of CPU time"),
        ("CPU_TIME_S", lambda _: time.sleep(0.3), None),  # the process does not run
        ("HANG_S", lambda _: time.sleep(60.0), "DeadlineError: longer than 0.05 s"),
    ],
)
def test_an_input_that_takes_too_long_is_a_finding(limit, call, error, monkeypatch):
    monkeypatch.setattr(execution, limit, 0.05)
    with limits():
        finding = execute(call, b"", ())
    assert (finding and finding.error) == error
