"""Packets in the messages of a maker's driver in a ROS 2 recording (.db3)."""

from __future__ import annotations

import sqlite3
import struct
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

from modt.errors import MisuseError
from tools.send.faults import Timed

LAYOUTS = {"velodyne_msgs/msg/VelodyneScan": (1206, None), "pandar_msgs/msg/PandarScan": (1500, 1508)}
"""Bytes that a message keeps for a packet, and where the packet's length stands behind its time, by type."""


def packets_of_bag(path: Path) -> Iterator[Timed]:
    """Packets of a folder or a file, with their times since the first [s].

    Raises:
        MisuseError: it holds no messages of packets.
    """
    file = next(path.glob("*.db3"), path) if path.is_dir() else path
    if not file.is_file():
        raise MisuseError(path, "no such recording", "give a folder or a .db3 file of ROS 2")
    with closing(sqlite3.connect(f"{file.resolve().as_uri()}?mode=ro&immutable=1", uri=True)) as bag:
        rows = bag.execute("select type, data from messages m join topics t on m.topic_id = t.id order by timestamp")
        messages = [(LAYOUTS[kind], data) for kind, data in rows if kind in LAYOUTS]
    if not messages:
        raise MisuseError(path, "no messages of packets", f"give a recording of {' or '.join(LAYOUTS)}")
    began_s = None
    for (size, length_at), data in messages:
        at = 16 + struct.unpack_from("<I", data, 12)[0]  # behind the header, whose frame is a text
        at += -at % 4
        step = 8 + size + (-size % 4) + (0 if length_at is None else 4)
        for start in range(at + 4, at + 4 + step * struct.unpack_from("<I", data, at)[0], step):
            second, fraction = struct.unpack_from("<II", data, start)
            length = size if length_at is None else struct.unpack_from("<I", data, start + length_at)[0]
            began_s = second + 1e-9 * fraction if began_s is None else began_s
            yield second + 1e-9 * fraction - began_s, data[start + 8 : start + 8 + length]
