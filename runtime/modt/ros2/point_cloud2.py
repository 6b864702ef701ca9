"""Messages of type sensor_msgs/PointCloud2."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray

from modt.ros2.cdr import CdrReader, CdrWriter, MessageError
from modt.types import UNRECORDED, Float32

TYPE = "sensor_msgs/PointCloud2"
NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""NumPy's name of each sensor_msgs/PointField datatype."""
DATATYPES = {name: number for number, name in NUMBERS.items()}
XYZI = np.dtype([(name, "<f4") for name in ("x", "y", "z", "intensity")])
REFLECTANCES = ("reflectivity", "reflectance", "remission", "remissions", "intensity", "i")
"""Names of the field, by preference: a calibrated reflectance goes before a raw intensity."""
_PREFIX = re.compile(r"^(?:(?:scalar|field|vertex|lidar)[_ .])+")
"""Prefixes of CloudCompare and others, as in `scalar_Intensity` and `Scalar_field_intensity`."""
TIMES = ("time", "t", "timestamp", "offset_time", "time_stamp")
MAX_FIELDS = 64
MAX_DELAY_S = 1.0
"""Greatest difference of the times of points from the header's stamp [s]. Beyond it they count from that stamp."""
FULL_SCALES = ((255.0, 65535.0), (1.0, 255.0))
"""Limits and full scales: the first limit that more than MAX_SHARE_ABOVE of the reflectances exceed decides."""
MAX_SHARE_ABOVE = 0.02
SAMPLES = 4096


def reflectance_name(names: Iterable[str]) -> str | None:
    """The name of the field of reflectance among those of a message or a file; None without one."""
    plain = {_PREFIX.sub("", name.lower()): name for name in names}
    return next((plain[name] for name in REFLECTANCES if name in plain), None)


@dataclass(frozen=True, slots=True)
class PointCloud:
    """A sweep as received.

    Attributes:
        ahead_s: time of straight ahead, or the stamp of a sweep that is not skewed [s]; 0 if the driver states none.
        frame_id: frame of the coordinates.
        points: (N, 4) float32 x, y, z [m], reflectance or UNRECORDED. Points without a return lie at the origin.
        turn_s: as in Frame.turn_s, by the times of the points; 0 if they tell none.
    """

    ahead_s: float
    frame_id: str
    points: Float32
    turn_s: float


def read_cloud(message: bytes) -> PointCloud:
    """The sweep in a message, of either byte order.

    Raises:
        MessageError: `malformed`, `empty`, or `fields`: without x, y and z as floating-point numbers.
    """
    cdr = CdrReader(message)
    stamp_s, frame_id = cdr.header()
    height = cdr.count()
    width = cdr.count()
    table = _table(cdr, height, width, _fields(cdr))
    fields: Mapping[str, Any] = table.dtype.fields or {}
    points = _points(table, fields)
    time = next((name for name in TIMES if name in fields), None)
    with np.errstate(all="ignore"):  # times may be any numbers
        turn = None if time is None else turn_of(points, table[time].reshape(-1))
    turn_s, ahead_s = turn or (0.0, 0.0)
    if turn and stamp_s:
        stamp_s = ahead_s if abs(ahead_s - stamp_s) < MAX_DELAY_S else stamp_s + ahead_s
    return PointCloud(stamp_s, frame_id, points, turn_s)


def write_cloud(stamp_s: float, frame_id: str, points: Float32) -> bytes:
    """A message of (N, 4) points: x, y, z and intensity in float32."""
    return write_table(stamp_s, frame_id, np.ascontiguousarray(points, "<f4").reshape(-1).view(XYZI))


def write_table(stamp_s: float, frame_id: str, points: NDArray[np.void]) -> bytes:
    """A message of an (N,) structured array in little-endian order, whose fields become those of the message."""
    fields: Mapping[str, Any] = points.dtype.fields or {}
    step = points.dtype.itemsize
    cdr = CdrWriter()
    cdr.header(stamp_s, frame_id)
    cdr.record(("3I",), 1, len(points), len(fields))
    for name, (kind, offset) in fields.items():
        cdr.text(name)
        cdr.record(("I", "B", "I"), offset, DATATYPES[kind.str[1:]], 1)
    cdr.record(("B", "2I"), 0, step, step * len(points))
    cdr.octets(points.view(np.uint8).data)
    cdr.record(("B",), 1)
    return cdr.message()


def _fields(cdr: CdrReader) -> dict[str, tuple[str, int]]:
    """Types and offsets by lower-case name."""
    n = cdr.count()
    if n > MAX_FIELDS:
        raise MessageError("malformed", f"{n} fields")
    fields = {}
    for _ in range(n):
        name = cdr.text()
        offset = cdr.count()
        datatype = int(cdr.number("B"))
        cdr.count()  # number of values of the field in a point, of which the first is used
        if datatype in NUMBERS:
            fields[name.lower()] = NUMBERS[datatype], offset
    return fields


def _table(cdr: CdrReader, height: int, width: int, kinds: dict[str, tuple[str, int]]) -> NDArray[Any]:
    """(height, width) records of the points, which are not copied; fields beyond the size of a point are left out.

    Raises:
        MessageError: `empty`, or `malformed`: the data are too few for the points.
    """
    order = ">" if cdr.number("B") else "<"
    point_step = cdr.count()
    row_step = cdr.count()
    data = cdr.octets()
    if not height * width:
        raise MessageError("empty", "no points")
    if height == 1:  # a single row may state 0
        row_step = point_step * width
    if row_step < width * point_step or (height - 1) * row_step + width * point_step > len(data):
        raise MessageError("malformed", f"{len(data)} bytes are too few for {height} x {width} points")
    within = {name: (kind, at) for name, (kind, at) in kinds.items() if at + np.dtype(kind).itemsize <= point_step}
    formats = [order + kind for kind, _ in within.values()]
    offsets = [at for _, at in within.values()]
    row = np.dtype({"names": [*within], "formats": formats, "offsets": offsets, "itemsize": point_step})
    return np.ndarray((height, width), row, data, 0, (row_step, point_step))


def _points(table: NDArray[Any], fields: Mapping[str, Any]) -> Float32:
    """(N, 4) points of the records, as in PointCloud, by type and offset of each field."""
    xyz = [fields[name] for name in "xyz" if name in fields]
    if len(xyz) < 3 or any(kind.kind != "f" for kind, _ in xyz):
        there = ", ".join(f"{name} ({kind.name})" for name, (kind, _) in fields.items()) or "none"
        raise MessageError("fields", f"no x, y, z of floating point among {there}")
    reflectance = reflectance_name(fields)
    points = np.empty((table.size, 4), np.float32)
    rows = points.reshape(*table.shape, 4)
    kind, offset = xyz[0]
    with np.errstate(all="ignore"):  # float64 beyond float32, and NaN
        if [*xyz, reflectance and fields[reflectance]] == [(kind, offset + k * kind.itemsize) for k in range(4)]:
            rows[...] = as_strided(table["x"], rows.shape, (*table.strides, kind.itemsize))
        else:
            for k, name in enumerate((*"xyz", reflectance)):
                rows[..., k] = UNRECORDED if name is None else table[name]
        _scale(points[:, 3])
    if not np.isfinite(points).all():  # most drivers mark points without a return by NaN
        points[~np.isfinite(points[:, :3]).all(axis=1), :3] = 0.0
        points[~np.isfinite(points[:, 3]), 3] = UNRECORDED
    return points


def _scale(reflectance: Float32) -> None:
    """Scale to [0, 1] in place, from 8 or 16 bits if more than a few of a sample exceed 1 or 255."""
    sample = reflectance[:: max(1, len(reflectance) // SAMPLES)]
    if sample.max() <= 1.0:
        return
    above = [(full, np.count_nonzero(sample > limit)) for limit, full in FULL_SCALES]
    full = next((full for full, count in above if count > MAX_SHARE_ABOVE * len(sample)), 1.0)
    reflectance[:] = np.minimum(reflectance / np.float32(full), np.float32(1.0))


TURN_SAMPLES = 512
"""Number of points that the motion is estimated from."""
SPANS_S = (0.02, 0.5)
"""Shortest and longest sweep [s]. The unit of the times is the one in which their span lies between these."""
UNITS_S = (1.0, 1e-6, 1e-9)
MAX_RESIDUAL = 0.03
"""Share of a turn by which most points may deviate from the line of time over bearing."""


def turn_of(points: Float32, times: NDArray[np.generic]) -> tuple[float, float] | None:
    """Duration of a turn, as in Frame.turn_s, and time of straight ahead by the clock of the points [s].

    None for a sweep whose seam does not lie behind the sensor, or times that fit no turn.

    Args:
        points: (N, 4) points of the sweep; those at the origin are ignored.
        times: (N,) times of the points, in seconds, microseconds or nanoseconds.
    """
    chosen = slice(None, None, max(1, len(points) // TURN_SAMPLES))
    x, y, _, _ = points[chosen].T.astype(np.float64)
    t = times[chosen].astype(np.float64)
    used = ((x != 0) | (y != 0)) & np.isfinite(t)
    if used.sum() < TURN_SAMPLES // 8:
        return None
    t = t[used]
    unit_s = next((unit for unit in UNITS_S if SPANS_S[0] <= np.ptp(t) * unit <= SPANS_S[1]), None)
    if unit_s is None:
        return None
    begin = t.min()
    t = (t - begin) * unit_s
    bearing = np.arctan2(y[used], x[used])
    slope, ahead_s = np.polyfit(bearing, t, 1)
    turn_s = -2 * np.pi * slope
    off = np.quantile(np.abs(t - slope * bearing - ahead_s), 0.9)
    if not off <= MAX_RESIDUAL * abs(turn_s):
        return None
    return float(turn_s), float(begin * unit_s + ahead_s)
