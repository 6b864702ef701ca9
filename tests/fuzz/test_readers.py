"""Whatever the bytes: they are read, or refused by an error of ours, in time and within the memory."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fuzz.execution import Finding, execute, limits
from tests.fuzz.mutation import mutations
from tests.fuzz.target import Target
from tests.fuzz.targets import TARGETS

READERS = pytest.mark.parametrize("target", TARGETS.values(), ids=TARGETS)
FEW, MANY = 100, 2000


def findings(target: Target, folder: Path, n: int, seed: int) -> list[Finding]:
    seeds, call = target.prepare(folder)
    with limits():
        read = (execute(call, raw, target.refusals) for raw in mutations(seeds, n, seed))
        return [found for found in read if found is not None]


@READERS
def test_valid_bytes_are_read(target: Target, tmp_path: Path) -> None:
    seeds, call = target.prepare(tmp_path)
    call(seeds[0])


@READERS
def test_broken_bytes_are_refused(target: Target, tmp_path: Path) -> None:
    assert [f"{f.error} ({f.place})" for f in findings(target, tmp_path, FEW, 1)] == []


@pytest.mark.slow
@READERS
def test_many_broken_bytes_are_refused(target: Target, tmp_path: Path) -> None:
    assert [f"{f.error} ({f.place})" for f in findings(target, tmp_path, MANY, 2)] == []
