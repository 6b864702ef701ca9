"""Recordings of 64 KiB, made to take time and memory, are read or refused within what SECURITY.md promises."""

import random
import struct
import tracemalloc
from pathlib import Path

import pytest
import zstandard

from modt.errors import ModtError
from modt.sources.recognise import open_stream
from tests.fuzz import hostile
from tests.fuzz.execution import execute, limits


def read(path: Path) -> None:
    """Every frame; a refusal for want of memory is none."""
    try:
        assert all(len(frame.points) < 2**21 for frame in open_stream(path))
    except ModtError as error:
        if "MemoryError" in str(error) or "\n" in str(error):
            raise AssertionError(str(error)) from None
        raise


def made(folder: Path, maker: str, seed: int) -> Path:
    name, make = hostile.MAKERS[maker]
    path = folder / name
    make(path, random.Random(seed))
    return path


@pytest.mark.parametrize("maker", hostile.MAKERS)
@pytest.mark.parametrize("seeds", [range(8), pytest.param(range(8, 60), marks=pytest.mark.slow)])
def test_a_hostile_recording_is_read_or_refused(maker: str, seeds: range, tmp_path: Path) -> None:
    found = []
    for seed in seeds:
        path = made(tmp_path, maker, seed)
        if path.stat().st_size <= 2 * hostile.MOST_BYTES:
            with limits():
                finding = execute(lambda _, path=path: read(path), b"", (ModtError,))
            if finding is not None:
                found.append(f"{seed}: {finding.error} ({finding.place})")
        path.unlink()
    assert found == []


@pytest.mark.parametrize("schema", [2, 3, 4, 9])
def test_views_and_triggers_are_refused_by_their_name(schema: int, tmp_path: Path) -> None:
    path = tmp_path / "a.db3"
    hostile.database(path, random.Random(schema), schema)
    with limits(), pytest.raises(ModtError, match=r"which is no table"):
        open_stream(path)


@pytest.mark.parametrize("maker", ["packed database", "packed mcap"])
def test_a_file_that_unpacks_to_too_much_is_refused_with_the_limit(maker: str, tmp_path: Path) -> None:
    with limits(), pytest.raises(ModtError, match=r"unpacks to more than 64 times its size and 16 MiB"):
        open_stream(made(tmp_path, maker, 0))


def test_an_index_that_begins_at_a_bomb_unpacks_nothing(tmp_path: Path) -> None:
    packed = zstandard.compress(bytes(2**28))
    body = struct.pack("<QQQI", 0, 0, 2**28, 0) + hostile.text(b"zstd") + struct.pack("<Q", len(packed)) + packed
    footer = hostile.record(hostile.FOOTER, struct.pack("<QQI", 8, 0, 0))
    path = tmp_path / "a.mcap"
    path.write_bytes(hostile.MAGIC + hostile.record(hostile.CHUNK, body) + footer + hostile.MAGIC)
    tracemalloc.start()
    try:
        with pytest.raises(ModtError, match="unpacks to more than 64 times its size and 16 MiB"):
            open_stream(path)
        assert tracemalloc.get_traced_memory()[1] < 2**26
    finally:
        tracemalloc.stop()
