"""Messages of Livox's own type, CustomMsg, which its drivers send unless they are told to send PointCloud2."""

from __future__ import annotations

import numpy as np

from modt.ros2.cdr import CdrReader, MessageError
from modt.ros2.point_cloud2 import PointCloud, Table, cloud_of

TYPES = frozenset(f"{package}/CustomMsg" for package in ("livox_ros_driver2", "livox_ros_driver", "livox_interfaces"))
POINT_BYTES = 20
"""Size of a point in a sequence: 19 bytes, each point at a multiple of four [bytes]."""


def read_livox_cloud(message: bytes) -> PointCloud:
    """The sweep in a message: times of points count from its stamp.

    Raises:
        MessageError: `malformed`, or `empty`.
    """
    cdr = CdrReader(message)
    stamp_s, frame_id = cdr.header()
    cdr.number("Q")  # time base, which the stamp of the header repeats
    cdr.count()
    cdr.number("I")  # identity of the sensor, and three bytes that are reserved
    n = cdr.count()
    if not n:
        raise MessageError("empty", "no points")
    data = cdr.rest()
    if len(data) < n * POINT_BYTES - 1:
        raise MessageError("malformed", f"{len(data)} bytes are too few for {n} points")
    row = np.dtype(
        {
            "names": ["offset_time", "x", "y", "z", "reflectivity"],
            "formats": [cdr.order + kind for kind in ("u4", "f4", "f4", "f4", "u1")],
            "offsets": [0, 4, 8, 12, 16],
            "itemsize": POINT_BYTES,
        }
    )
    rows = np.frombuffer(bytes(data[: n * POINT_BYTES]).ljust(n * POINT_BYTES, b"\0"), row)
    return cloud_of(stamp_s, frame_id, Table(rows.reshape(1, -1)))
