"""Recordings damaged at random places, and what other readers give of them."""

import random
import shutil
import sqlite3
import struct
import subprocess
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, Message
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import CompressionType
from zstandard import ZstdDecompressor

from modt.errors import ModtError
from modt.sources.recognise import open_stream
from tests.ros2 import messages
from tests.sources.bags import BEGAN_S, CLOUD, UP, write_mcap, write_rosbag2
from tests.sources.packets import pcapng
from tests.sources.packets.simulated import packets
from tools.send.pcap_writer import write_capture

N = 24
POINTS = 300
"""Number of points of the first sweep; each later one has one more."""
PARTS = 4
"""Number of files of a split recording."""
TURNS = 6
"""Number of turns in a capture, which begins and ends with others."""
PCAP_HEAD = 24
RECORD_HEAD = 16
SQLITE = shutil.which("sqlite3")


def _sweep(k):
    stamp_s = BEGAN_S + k / 10
    data = messages.encode(messages.cloud(messages.xyzi(POINTS + k), stamp_s=stamp_s))
    return "/points", CLOUD, stamp_s + 0.03, data


def _pose(k):
    stamp_s = BEGAN_S + k / 10
    pose = messages.odometry(stamp_s, [10.0 + k / 10, 0.0, 0.0], UP, "lidar")
    return "/odom", "nav_msgs/msg/Odometry", stamp_s + 0.001, messages.encode(pose)


SWEEPS = [_sweep(k) for k in range(N)]
RECORDED = [message for k in range(N) for message in (_pose(k), SWEEPS[k])]
NUMBER = {message[3]: k for k, message in enumerate(SWEEPS)}


def _mcap(**options):
    def write(folder):
        return write_mcap(folder / "drive", RECORDED, **{"chunk_size": 12_000, **options})

    return write


def _unclosed(folder):
    path = _mcap()(folder)
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 9 // 10])
    return path


def _database(compressed=None):
    def write(folder):
        bag = write_rosbag2(folder / "written", RECORDED, compressed)
        (file,) = (f for f in bag.iterdir() if ".db3" in f.name)
        return file.rename(folder / file.name.replace("written", "drive"))

    return write


def _split(kind):
    def write(folder):
        bag = folder / "drive"
        bag.mkdir()
        size = len(RECORDED) // PARTS
        names = []
        for k in range(PARTS):
            part = RECORDED[size * k : size * (k + 1)]
            if kind == "mcap":
                file = write_mcap(bag / f"drive_{k}", part, chunk_size=9000)
            else:
                (file,) = write_rosbag2(folder / f"part{k}", part).glob("*.db3")
                file = file.rename(bag / f"drive_{k}.db3")
            names.append(file.name)
        files = "".join(f"  - {name}\n" for name in names)
        counts = "".join(
            f"  - topic_metadata: {{name: {topic}}}\n    message_count: {N}\n" for topic in ("/points", "/odom")
        )
        (bag / "metadata.yaml").write_text(
            f"rosbag2_bagfile_information:\n  relative_file_paths:\n{files}  topics_with_message_count:\n{counts}"
        )
        return bag

    return write


def _capture(folder):
    path = folder / "drive.pcap"
    write_capture(path, packets("vlp-16", TURNS), 2368)
    return path


def _capture_in_blocks(folder):
    path = folder / "drive.pcapng"
    path.write_bytes(pcapng.captured(packets("vlp-16", TURNS), 2368))
    return path


WRITERS: dict[str, Callable[[Path], Path]] = {
    "mcap zstd": _mcap(),
    "mcap lz4": _mcap(compression=CompressionType.LZ4),
    "mcap plain": _mcap(compression=CompressionType.NONE),
    "mcap without checksums": _mcap(compression=CompressionType.NONE, enable_crcs=False),
    "mcap unchunked": _mcap(use_chunking=False),
    "mcap unclosed": _unclosed,
    "split mcap": _split("mcap"),
    "db3": _database(),
    "db3 of compressed messages": _database("message"),
    "compressed db3": _database("file"),
    "split db3": _split("db3"),
    "pcap": _capture,
    "pcapng": _capture_in_blocks,
}
"""Writers of a recording into a folder by the form of the recording."""


def damage(path, chance):
    """Damage a recording: bytes of a file, its end, or whole files of a split one."""
    if not path.is_dir():
        path.write_bytes(_damaged(path.read_bytes(), chance, first=8))
        return
    files = sorted(file for file in path.iterdir() if file.suffix != ".yaml")
    for file in chance.sample(files, chance.choice([1, 2])):
        if chance.random() < 0.4:
            file.unlink()
        else:
            file.write_bytes(_damaged(file.read_bytes(), chance, first=0))


def _damaged(raw, chance, first):
    """The bytes with flipped bits, overwritten, erased, inserted or removed parts, or cut off."""
    raw = bytearray(raw)
    kind = chance.choice(["flip", "flip", "overwrite", "erase", "page", "insert", "remove", "cut", "cut"])
    for _ in range(chance.choice([1, 1, 2, 5])):
        at = chance.randrange(first, len(raw))
        size = chance.choice([1, 16, 700, 5000])
        if kind == "flip":
            raw[at] ^= 1 << chance.randrange(8)
        elif kind == "overwrite":
            raw[at : at + size] = chance.randbytes(len(raw[at : at + size]))
        elif kind == "erase":
            raw[at : at + size] = bytes(len(raw[at : at + size]))
        elif kind == "page":
            at -= at % 4096
            raw[at : at + 4096] = bytes(len(raw[at : at + 4096]))
        elif kind == "insert":
            raw[at:at] = chance.randbytes(size)
        elif kind == "remove":
            del raw[at : at + size]
    if kind == "cut":
        del raw[chance.randrange(len(raw) // 10, len(raw)) :]
    return bytes(raw)


def _by_mcap(path):
    """Messages that the library gives from the begin on, past bad chunks as in `mcap recover`, and by the index."""
    found = set()
    channels = set()
    with suppress(Exception), path.open("rb") as file:
        for record in StreamReader(file, emit_chunks=True, record_size_limit=2**28).records:
            within = [record]
            if isinstance(record, Chunk):
                within = []
                with suppress(Exception):
                    within = breakup_chunk(record, validate_crc=True)
            channels |= {one.id for one in within if isinstance(one, Channel)}
            found |= {one.data for one in within if isinstance(one, Message) and one.channel_id in channels}
    with suppress(Exception), path.open("rb") as file:
        for _, _, message in make_reader(file).iter_messages():
            found.add(message.data)
    return found


def _by_sqlite(path):
    """Messages that SQLite reads row by row, and those of `sqlite3 .recover` where it is installed."""
    found = _blobs(path)
    if SQLITE is not None:
        recovered = path.with_name("recovered.db3")
        script = subprocess.run([SQLITE, path, ".recover"], capture_output=True, check=False).stdout
        subprocess.run([SQLITE, recovered], input=script, capture_output=True, check=False)
        found |= _blobs(recovered)
        recovered.unlink(missing_ok=True)
    plain = set()
    for blob in found:
        with suppress(Exception):
            plain.add(ZstdDecompressor().decompress(blob, 2**24))
    return found | plain


def _blobs(path):
    """All bytes in the tables of a database."""
    found = set()
    uri = f"file:{path}?mode=ro"
    with suppress(sqlite3.Error, UnicodeDecodeError), closing(sqlite3.connect(uri, uri=True)) as database:
        database.text_factory = bytes
        tables = [
            name.decode() for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")
        ]
        for table in {*tables, "messages"}:
            with suppress(sqlite3.Error, UnicodeDecodeError):
                for row in database.execute(f'SELECT * FROM "{table}" NOT INDEXED'):
                    found |= {value for value in row if isinstance(value, bytes)}
    return found


def _by_zstd(path):
    """Messages of a compressed database, as far as it can be unpacked."""
    plain = path.with_name("plain.db3")
    with plain.open("wb") as file, suppress(Exception), path.open("rb") as packed:
        for piece in ZstdDecompressor().read_to_iter(packed, write_size=1024):
            file.write(piece)
    found = _by_sqlite(plain)
    plain.unlink()
    return found


def _given(path):
    """Numbers of the sweeps that other readers give of a file of a recording."""
    readers = {".mcap": _by_mcap, ".db3": _by_sqlite, ".zstd": _by_zstd}
    return {NUMBER[data] for data in readers[path.suffix](path) if data in NUMBER}


def _turns_given(path):
    """Number of turns in a capture up to the first bytes that are no record, as tcpdump reads it."""
    raw = path.read_bytes()
    clean = path.with_name("clean" + path.suffix)
    clean.write_bytes(raw[: _records_end(raw) if path.suffix == ".pcap" else _blocks_end(raw)])
    with suppress(ModtError):
        return sum(1 for _ in open_stream(clean))
    return 0


def _records_end(raw):
    at = PCAP_HEAD
    while at + RECORD_HEAD <= len(raw):
        second, fraction, size, original = struct.unpack_from("<IIII", raw, at)
        end = at + RECORD_HEAD + size
        if size > 262_144 or end > len(raw) or size > original or fraction >= 10**6 or abs(second - 1.6e9) > 1e5:
            break
        at = end
    return at


def _blocks_end(raw):
    at = 0
    while at + 12 <= len(raw):
        size = int.from_bytes(raw[at + 4 : at + 8], "little")
        if size < 12 or at + size > len(raw) or raw[at + 4 : at + 8] != raw[at + size - 4 : at + size]:
            break
        at += size
    return at


@dataclass
class Judgement:
    """Frames and counts read of a damaged recording.

    Attributes:
        given, read: number of sweeps that other readers give, and of those that were read.
        broken: the promise that is broken; empty if all are kept.
    """

    given: int
    read: int
    broken: str = ""


def judged(path):
    """Read a damaged recording: nothing that others give is lost, and what is lost is counted."""
    return _judged_capture(path) if path.suffix in (".pcap", ".pcapng") else _judged_bag(path)


def _judged_capture(path):
    given = _turns_given(path)
    try:
        stream = open_stream(path)
        read = sum(1 for _ in stream)
    except ModtError as error:
        return Judgement(given, 0, f"{given} sweeps are lost ({error})" if given else "")
    lost = given - read
    if lost > 0:
        return Judgement(given, read, f"{lost} sweeps are lost")
    if read < TURNS - 1 and not stream.faults.count:
        return Judgement(given, read, "a loss is not reported")
    return Judgement(given, read)


def _judged_bag(path):
    files = [file for file in path.iterdir() if file.suffix != ".yaml"] if path.is_dir() else [path]
    given = {k for file in files for k in _given(file)}
    try:
        stream = open_stream(path)
        frames = list(stream)
    except ModtError as error:
        return Judgement(len(given), 0, f"{len(given)} sweeps are lost ({error})" if given else "")
    whole = [k for frame in frames if (k := _whole(frame.points)) is not None]
    made = Judgement(len(given), len(frames))
    if given - {*whole}:
        made.broken = f"sweeps {sorted(given - {*whole})} are lost; {dict(stream.faults.left_out)}"
    elif len(whole) > len({*whole}):
        made.broken = "a sweep is read twice"
    elif whole != sorted(whole):
        made.broken = f"sweeps are out of order: {whole}"
    else:
        made.broken = _miscount(path, len(frames), stream.faults.left_out)
    return made


def _miscount(path, n_read, left_out):
    """How the account of a recording is wrong; empty if it is right."""
    if n_read < N and not left_out:
        return "a loss is not reported"
    sweeps = {why: n for why, n in left_out.items() if _of_messages(why)}
    lost = sum(sweeps.values())
    if n_read + lost > N:
        return f"{n_read} sweeps and {sweeps} are more than {N}"
    if path.is_dir() and n_read + lost < N:
        return f"{n_read} sweeps and {sweeps} are fewer than the {N} of metadata.yaml; {dict(left_out)}"
    return ""


def _of_messages(reason):
    """Whether a reason counts messages of sweeps, rather than damaged places."""
    places = ("the bytes from", "the chunk at", "the checksum", ".mcap", ".db3", "file number", "messages of /odom")
    return not any(place in reason for place in (*places, "messages of poses"))


def _whole(points):
    """Number of a sweep whose points are unchanged; None for another one."""
    k = len(points) - POINTS
    same = 0 <= k < N and np.array_equal(points, messages.xyzi(POINTS + k).view(np.float32).reshape(-1, 4))
    return k if same else None


def trial(folder, form, seed):
    """Write a recording of a form into an empty folder, damage it, and judge what is read."""
    path = WRITERS[form](folder)
    damage(path, random.Random(f"{form} {seed}"))
    return judged(path)
