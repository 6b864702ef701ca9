"""Recordings that were killed or are damaged: what they still hold is read, and what is lost is counted."""

import os
import sqlite3
import struct
from contextlib import closing

import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType
from zstandard import ZstdCompressor

from modt.errors import ModtError
from modt.sources.recognise import open_stream
from tests.sources.bags import by_time, clouds, poses, write_mcap, write_rosbag2

N = 12


def read(path):
    stream = open_stream(path)
    return stream, [frame.index for frame in stream]


def assert_whole(path):
    stream, frames = read(path)
    assert frames == list(range(N))
    assert not stream.faults.count


def write_split(folder, n_files, name="drive"):
    """The sweeps in several files, NAME_0.mcap and so on."""
    each = N // n_files
    return [write_mcap(folder / f"{name}_{k}", clouds(N)[each * k :][:each]) for k in range(n_files)]


def killed(folder, recorded, *pragmas, commit_every=2):
    """A database whose recorder ended without closing it, so that what it wrote last lies beside it."""
    folder.mkdir()
    path = folder / "drive_0.db3"
    if (child := os.fork()) == 0:
        database = sqlite3.connect(path, isolation_level=None)
        for pragma in pragmas:
            database.execute(pragma)
        database.execute(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, "
            "serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL)"
        )
        database.execute(
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, "
            "data BLOB NOT NULL)"
        )
        database.execute("INSERT INTO topics VALUES(1, '/points', 'sensor_msgs/msg/PointCloud2', 'cdr', '')")
        database.execute("BEGIN")
        for k, (_, _, recorded_s, data) in enumerate(recorded):
            row = (round(recorded_s * 1e9), data)
            database.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES(1, ?, ?)", row)
            if k % commit_every == commit_every - 1:
                database.execute("COMMIT")
                database.execute("BEGIN")
        os._exit(9)
    os.waitpid(child, 0)
    return folder, path


@pytest.mark.parametrize("as_folder", [True, False])
def test_what_a_killed_recorder_left_in_its_log_is_read(tmp_path, as_folder):
    folder, path = killed(tmp_path / "drive", clouds(N), "PRAGMA journal_mode=WAL", "PRAGMA wal_autocheckpoint=0")
    before = path.read_bytes()
    assert path.with_name("drive_0.db3-wal").stat().st_size
    assert_whole(folder if as_folder else path)
    assert path.read_bytes() == before


def test_an_unfinished_transaction_is_undone_in_a_copy(tmp_path):
    pragmas = ("PRAGMA cache_size=1", "PRAGMA cache_spill=1")
    _, path = killed(tmp_path / "drive", clouds(N + 1), *pragmas)
    before = path.read_bytes()
    _, frames = read(path)
    assert frames == list(range(N))
    assert path.read_bytes() == before


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("compression", ["zstd", ""])
def test_a_damaged_chunk_costs_its_own_messages(tmp_path, closed, compression):
    kind = CompressionType.ZSTD if compression else CompressionType.NONE
    path = write_mcap(tmp_path / "drive", clouds(N), chunk_size=900, compression=kind)
    with path.open("rb") as file:
        chunks = make_reader(file).get_summary().chunk_indexes
    raw = bytearray(path.read_bytes())
    at = (
        chunks[2].chunk_start_offset + 9 + 40 + len(compression)
    )  # its first message, or the begin of its compressed data
    raw[at : at + 30] = b"\xff" * 30
    path.write_bytes(raw if closed else raw[: chunks[-1].chunk_start_offset + chunks[-1].chunk_length])
    stream, frames = read(path)
    lost = sorted(set(range(N)) - set(frames))
    assert 1 <= len(lost) <= N // len(chunks) + 1
    assert frames[-1] == N - 1
    assert stream.faults.left_out["damaged in the recording"] == len(lost)


@pytest.mark.parametrize("header", [True, False])
def test_records_behind_damaged_bytes_are_found_without_an_index(tmp_path, header):
    path = write_mcap(tmp_path / "drive", clouds(N), use_chunking=False)
    raw = bytearray(path.read_bytes())
    places = [raw.index(struct.pack("<Q", round(message[2] * 1e9))) for message in clouds(N)]
    at = places[4] - 15 + (1 if header else 40)  # the length of the record, or its data
    raw[at : at + 8] = b"\xee" * 8
    path.write_bytes(raw)
    stream, frames = read(path)
    assert len(frames) >= N - 1
    assert stream.reading.messages + stream.faults.left_out.total() >= N


@pytest.mark.parametrize("left", [1, 4, 8])
def test_a_file_that_ends_within_the_head_of_a_record_is_not_whole(tmp_path, left):
    path = write_mcap(tmp_path / "drive", clouds(N), use_chunking=False)
    raw = path.read_bytes()
    at = raw.index(struct.pack("<Q", round(clouds(N)[7][2] * 1e9))) - 15  # begin of a message
    path.write_bytes(raw[: at + left])
    stream, frames = read(path)
    assert frames == list(range(7))
    assert stream.faults.left_out


def test_a_bad_file_of_a_split_recording_costs_no_other(tmp_path, caplog):
    first, second, third = write_split(tmp_path, 3)
    second.write_bytes(b"garbage" * 100)
    stream, frames = read(tmp_path)
    assert len(frames) == 8
    assert any("drive_1.mcap" in reason for reason in stream.faults.left_out)
    first.write_bytes(b"")
    third.write_bytes(b"")
    with pytest.raises(ModtError):
        open_stream(tmp_path)


def test_a_lost_file_of_a_split_recording_is_counted_by_its_metadata(tmp_path):
    folder = write_rosbag2(tmp_path / "drive", clouds(N))
    (file,) = folder.glob("*.db3")
    with closing(sqlite3.connect(file)) as database, database:
        database.execute("DELETE FROM messages WHERE id > 7")
    stream, frames = read(folder)
    assert frames == list(range(7))
    assert stream.faults.left_out["messages of /points are missing"] == N - 7


def test_a_file_that_the_metadata_list_twice_and_out_of_order_is_read_once_in_its_place(tmp_path):
    folder = tmp_path / "drive"
    folder.mkdir()
    write_split(folder, 3)
    listed = "\n".join(f"    - drive_{k}.mcap" for k in (2, 0, 1, 0))
    (folder / "metadata.yaml").write_text(f"rosbag2_bagfile_information:\n  relative_file_paths:\n{listed}\n")
    assert_whole(folder)


def pages_of(raw):
    return [raw[at : at + 4096] for at in range(0, len(raw), 4096)]


def big(n):
    """Messages that overflow a page."""
    return [(*message[:3], message[3] + bytes(9000)) for message in clouds(n)]


@pytest.mark.parametrize("what", ["index", "root of the table", "leaf", "overflow", "end"])
def test_a_damaged_database_gives_all_rows_that_its_pages_hold(tmp_path, what):
    (path,) = write_rosbag2(tmp_path / "drive", by_time(big(N), poses())).glob("*.db3")
    with closing(sqlite3.connect(path)) as database:
        root = dict(database.execute("SELECT name, rootpage FROM sqlite_master"))
    raw = bytearray(path.read_bytes())
    pages = pages_of(raw)
    leaves = [k for k, page in enumerate(pages) if page[0] == 13 and k and k + 1 != root["topics"]]
    overflow = [k for k, page in enumerate(pages) if not page[0] and any(page[:4])]
    lost = 0
    if what == "end":
        raw = raw[: len(raw) - len(raw) // 4]
    else:
        damaged = {"index": root["timestamp_idx"] - 1, "root of the table": root["messages"] - 1}
        page = damaged.get(what, leaves[len(leaves) // 2] if what == "leaf" else overflow[len(overflow) // 2])
        raw[4096 * page : 4096 * page + 64] = b"\xa5" * 64
    copy = tmp_path / "copy.db3"
    copy.write_bytes(raw)
    _, frames = read(copy)
    if what in ("index", "root of the table"):
        assert frames == list(range(N))
    elif what == "end":
        assert frames[: N // 2] == list(range(N // 2))
    else:
        lost = N - len(frames)
        assert lost <= 4


def test_a_file_that_is_missing_by_the_numbers_of_the_others_is_named(tmp_path):
    write_split(tmp_path, 4)[2].unlink()
    stream, frames = read(tmp_path)
    assert len(frames) == 9
    assert stream.faults.left_out == {"file number 2 is not there": 1}


def test_a_damaged_summary_loses_nothing(tmp_path):
    path = write_mcap(tmp_path / "drive", clouds(N))
    raw = bytearray(path.read_bytes())
    raw[-60:] = b"\xaa" * 60
    path.write_bytes(raw)
    assert_whole(path)


def test_a_chunk_is_read_whose_index_of_one_topic_is_damaged(tmp_path):
    path = write_mcap(tmp_path / "drive", by_time(clouds(N), poses("lidar")), compression=CompressionType.NONE)
    raw = bytearray(path.read_bytes())
    with path.open("rb") as file:
        (chunk,) = make_reader(file).get_summary().chunk_indexes
    points = max(chunk.message_index_offsets, key=chunk.message_index_offsets.get)
    at = chunk.message_index_offsets[points]
    path.write_bytes(raw[: at + 5])  # without the index of the second topic, and what follows it
    assert read(path)[1] == list(range(N))


def test_a_summary_without_channels_is_not_the_whole(tmp_path):
    path = write_mcap(
        tmp_path / "drive", clouds(N), repeat_channels=False, repeat_schemas=False, use_statistics=False
    )
    assert read(path)[1] == list(range(N))


def test_a_topic_that_a_database_lists_twice_is_one(tmp_path):
    (path,) = write_rosbag2(tmp_path / "drive", clouds(N)).glob("*.db3")
    with closing(sqlite3.connect(path)) as database, database:
        columns = ", ".join(row[1] for row in database.execute("PRAGMA table_info(topics)") if row[1] != "id")
        database.execute(f"INSERT INTO topics(id, {columns}) SELECT 9, {columns} FROM topics")
        database.execute("UPDATE messages SET topic_id = 9 WHERE id > 5")
    stream, frames = read(path)
    assert frames == list(range(N))
    assert stream.info.n_frames == N


@pytest.mark.parametrize("listed", [True, False])
def test_a_file_whose_compression_was_not_finished_is_read_once(tmp_path, listed):
    first, second, third = write_split(tmp_path, 3)
    packed = {file: ZstdCompressor().compress(file.read_bytes()) for file in (first, second)}
    first.with_name("drive_0.mcap.zstd").write_bytes(packed[first])
    first.unlink()
    second.with_name("drive_1.mcap.zstd").write_bytes(packed[second][:100])
    if listed:
        names = "".join(f"  - {name}\n" for name in ("drive_0.mcap.zstd", "drive_1.mcap.zstd", third.name))
        (tmp_path / "metadata.yaml").write_text(f"rosbag2_bagfile_information:\n  relative_file_paths:\n{names}")
    assert_whole(tmp_path)


def test_a_recording_that_was_renamed_is_whole(tmp_path):
    write_split(tmp_path, 2, "walk")
    (tmp_path / "metadata.yaml").write_text(
        "rosbag2_bagfile_information:\n  relative_file_paths: [old/drive_0.mcap, old/drive_1.mcap]\n"
    )
    assert_whole(tmp_path)


@pytest.mark.parametrize("listed", [True, False])
def test_files_beside_a_recording_are_no_part_of_it(tmp_path, listed):
    for file in write_split(tmp_path, 2):
        file.with_name(f"._{file.name}").write_bytes(b"copied by another system")
    if listed:
        write_mcap(tmp_path / "results", clouds(N, "/modt/points"))
        (tmp_path / "metadata.yaml").write_text(
            "rosbag2_bagfile_information:\n  relative_file_paths: [drive_0.mcap, drive_1.mcap]\n"
        )
    assert_whole(tmp_path)


def test_an_empty_file_is_named(tmp_path):
    write_mcap(tmp_path / "drive_0", clouds(N))
    (tmp_path / "drive_1.db3").write_bytes(b"")
    stream, frames = read(tmp_path)
    assert frames == list(range(N))
    assert stream.faults.left_out == {"drive_1.db3 is empty": 1}
