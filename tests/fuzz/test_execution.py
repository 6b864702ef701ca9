"""Limits of one input."""

from __future__ import annotations

import time

import pytest

from tests.fuzz import execution
from tests.fuzz.execution import execute, limits


def spin(_: bytes) -> None:
    while True:
        pass


def test_an_input_that_takes_too_much_cpu_time_is_a_finding(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(execution, "CPU_TIME_S", 0.05)
    with limits():
        finding = execute(spin, b"", ())
    assert finding is not None
    assert finding.error == "DeadlineError: longer than 0.05 s of CPU time"


def test_time_in_which_the_process_does_not_run_counts_for_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(execution, "CPU_TIME_S", 0.1)
    with limits():
        assert execute(lambda _: time.sleep(0.3), b"", ()) is None


def test_an_input_that_hangs_is_a_finding(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(execution, "HANG_S", 0.05)
    with limits():
        finding = execute(lambda _: time.sleep(60.0), b"", ())
    assert finding is not None
    assert finding.error == "DeadlineError: longer than 0.05 s"
