"""Readers read any bytes, or refuse them with an error of modt, within a time and a memory."""

import time

import pytest

from tests.fuzz import execution
from tests.fuzz.execution import execute, limits
from tests.fuzz.mutation import mutations
from tests.fuzz.targets import TARGETS

READERS = pytest.mark.parametrize("target", TARGETS.values(), ids=TARGETS)


@READERS
def test_valid_bytes_are_read(target, tmp_path):
    seeds, call = target.prepare(tmp_path)
    call(seeds[0])


@READERS
@pytest.mark.parametrize(("n", "seed"), [(50, 1), pytest.param(500, 2, marks=pytest.mark.slow)])
def test_broken_bytes_are_refused(target, n, seed, tmp_path):
    seeds, call = target.prepare(tmp_path)
    with limits():
        findings = [execute(call, raw, target.refusals) for raw in mutations(seeds, n, seed)]
    assert [f"{f.error} ({f.place})" for f in findings if f is not None] == []


def spin(_):
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
