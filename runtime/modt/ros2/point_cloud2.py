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
from modt.types import COMPENSATED, DESKEWED, NO_TURN, UNRECORDED, Float32, Float64

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
"""Names of the field of the times of points, by preference; else another one with `time` or `stamp` in its name."""
FOREIGN_FRAMES = frozenset({"map", "odom", "world", "earth", "base_link", "base_footprint", "camera_init"})
"""Conventional names of frames that do not belong to a sensor (REP 105), and that of LOAM's world."""
OPTICAL = "_optical_frame"
"""End of the name of a frame whose x axis points right, y down and z forward (REP 103)."""
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


@dataclass(frozen=True)
class PointCloud:
    """A message of points as received.

    Attributes:
        stamp_s: stamp as in Frame [s]; 0 if the driver states none.
        frame_id: frame of the coordinates.
        points: (N, 4) float32 x, y, z [m], reflectance or UNRECORDED. Points without a return lie at the origin.
        turn_s, mid_rad: as in Frame, by the times of the points; 0 if they tell no turn.
        began_s: time of the first point [s], the stamp where points have no times.
        times: what the times of the points are, for the account of what was read.
        corrected: what the message says of its own layout and is not so; empty if all is as it says.
        delay_s: as in Frame.
    """

    stamp_s: float
    frame_id: str
    points: Float32
    turn_s: float = 0.0
    mid_rad: float = 0.0
    began_s: float = 0.0
    times: str = COMPENSATED
    corrected: str = ""
    delay_s: Float32 | None = None


@dataclass(frozen=True)
class Table:
    """Records of points, and what was corrected to read them."""

    rows: NDArray[Any]
    corrected: str = ""


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
    return cloud_of(stamp_s, frame_id, table)


def cloud_of(stamp_s: float, frame_id: str, table: Table) -> PointCloud:
    """The sweep of a table of points.

    Raises:
        MessageError: `fields`: without x, y and z as floating-point numbers.
    """
    fields: Mapping[str, Any] = table.rows.dtype.fields or {}
    points = _points(table.rows, fields)
    others = (name for name in fields if "time" in name or "stamp" in name)
    name = next((name for name in TIMES if name in fields), None) or next(others, None)
    if name is None:
        return PointCloud(stamp_s, frame_id, points, began_s=stamp_s, corrected=table.corrected)
    with np.errstate(all="ignore"):  # times may be any numbers
        turn = turn_of(points, table.rows[name].reshape(-1))
    if isinstance(turn, str):
        return PointCloud(stamp_s, frame_id, points, began_s=stamp_s, times=turn, corrected=table.corrected)
    # Times are on the clock of the header, or count from its stamp, as they do without a stamp.
    since_s = 0.0 if not stamp_s or abs(turn.mid_s - stamp_s) < MAX_DELAY_S else stamp_s
    seen_s = turn.mid_s + since_s if stamp_s else 0.0
    began_s = turn.began_s + since_s if stamp_s else 0.0
    if turn.turn_s:
        forms = (turn.turn_s, turn.mid_rad, began_s, DESKEWED, table.corrected)
        return PointCloud(seen_s, frame_id, points, *forms)
    delay_s = _delays(table.rows[name].reshape(-1), turn)
    return PointCloud(
        seen_s, frame_id, points, began_s=began_s, times=NO_TURN, corrected=table.corrected, delay_s=delay_s
    )


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


def _table(cdr: CdrReader, height: int, width: int, kinds: dict[str, tuple[str, int]]) -> Table:
    """(height, width) records of the points, which are not copied; fields beyond the size of a point are left out.

    Drivers are known to state another size of a row than that of their dense rows, and another order of bytes than
    the one in which coordinates make sense.

    Raises:
        MessageError: `empty`, or `malformed`: the data are too few for the points.
    """
    big = bool(cdr.number("B"))
    point_step = cdr.count()
    row_step = cdr.count()
    data = cdr.octets()
    if not height * width:
        raise MessageError("empty", "no points")
    dense = width * point_step
    beyond = row_step < dense or (height - 1) * row_step + dense > len(data)
    corrected = ""
    if height == 1:  # a single row may state 0
        row_step = dense
    elif beyond and len(data) == height * dense:
        corrected = f"row_step is {row_step}, rows have {dense} bytes"
        row_step = dense
    if row_step < dense or (height - 1) * row_step + dense > len(data):
        raise MessageError("malformed", f"{len(data)} bytes are too few for {height} x {width} points")
    shape = (height, width)
    steps = (row_step, point_step)
    rows = _rows(data, kinds, shape, steps, big=big)
    if not _sensible(rows) and _sensible(swapped := _rows(data, kinds, shape, steps, big=not big)):
        rows = swapped
        corrected = "; ".join(filter(None, [corrected, f"is_bigendian is {str(big).lower()}, which is wrong"]))
    return Table(rows, corrected)


def _rows(
    data: memoryview, kinds: dict[str, tuple[str, int]], shape: tuple[int, int], steps: tuple[int, int], *, big: bool
) -> NDArray[Any]:
    """Records over the data; `steps` are the sizes of a row and of a point [bytes]."""
    point_step = steps[1]
    within = {name: (kind, at) for name, (kind, at) in kinds.items() if at + np.dtype(kind).itemsize <= point_step}
    formats = [(">" if big else "<") + kind for kind, _ in within.values()]
    offsets = [at for _, at in within.values()]
    row = np.dtype({"names": [*within], "formats": formats, "offsets": offsets, "itemsize": point_step})
    return np.ndarray(shape, row, data, 0, steps)


SENSIBLE_M = (1e-4, 1e5)
"""Coordinates between these sizes make sense, as do 0 and values that are not finite, which mean no return [m]."""
CHECKED = 64


def _sensible(rows: NDArray[Any]) -> bool:
    """Whether most coordinates of a sample of points make sense."""
    if "x" not in (rows.dtype.names or ()) or rows.dtype["x"].kind != "f":
        return True  # it is refused for what it is
    x = np.abs(rows["x"][:, :: max(1, rows.shape[1] // CHECKED)])
    with np.errstate(invalid="ignore"):
        odd = (x != 0) & ((x < SENSIBLE_M[0]) | ((x > SENSIBLE_M[1]) & (x < np.inf)))
    return bool(np.count_nonzero(odd) <= odd.size // 4)


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
        # Where all four lie one behind the other in one type, as most drivers write them, they are copied at once.
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
UNITS_S = (1.0, 1e-3, 1e-6, 1e-9)
MAX_RESIDUAL = 0.03
"""Share of a turn by which most points may deviate from the line of time over the angle that the head has turned."""
FIRST_SHARE = 0.05
"""Share of the points by which the bearing is known at which a sweep begins."""
MARGIN_RAD = 0.35
"""Angle before that bearing in which points still count as seen at the begin [rad]."""
MARGIN_S = 0.01
"""Time beyond the first and the last sampled point within which other points of a sweep lie [s]."""
EDGE_RAD = 0.02
"""Angle before the fitted begin of a sweep in which points still count as seen at the begin [rad]."""
AHEAD_RAD = 0.2
"""A sweep whose middle lies within this angle of straight ahead is stamped there [rad]."""


@dataclass(frozen=True)
class Turn:
    """A turn of a head: turn_s, mid_rad as in Frame, times of its first point and of mid_rad by the points' clock.

    A sensor without a turning head has turn_s 0, and mid_s is the middle of its times. The unit of the times is that
    of the message.
    """

    turn_s: float
    mid_rad: float
    began_s: float
    mid_s: float
    unit_s: float = 1.0


def turn_of(points: Float32, times: NDArray[np.generic]) -> Turn | str:
    """The turn that the times of the points tell, wherever its seam is; the reason if they span no sweep.

    Args:
        points: (N, 4) points of the sweep; those at the origin are ignored.
        times: (N,) times of the points, in s, ms, µs or ns; few of them may be wild.
    """
    chosen = slice(None, None, max(1, len(points) // TURN_SAMPLES))
    x, y, _, _ = points[chosen].T.astype(np.float64)
    t = times[chosen].astype(np.float64)
    used = ((x != 0) | (y != 0)) & np.isfinite(t)
    if used.sum() < TURN_SAMPLES // 8:
        return "too few points with times"
    early, middle, late = np.quantile(t[used], (0.02, 0.5, 0.98))
    if early == late:
        return COMPENSATED
    used &= np.abs(t - middle) <= late - early  # without wild times
    unit_s = next((unit for unit in UNITS_S if SPANS_S[0] <= np.ptp(t[used]) * unit <= SPANS_S[1]), None)
    if unit_s is None:
        return "their points' times span no sweep"
    begin = t[used].min()
    since_s = (t[used] - begin) * unit_s
    bearing = np.arctan2(y[used], x[used])
    # The head turns one way or the other: the one whose line of time over angle fits better.
    turn = min((_fitted(bearing, since_s, way) for way in (1.0, -1.0)), key=lambda fit: fit[1])[0]
    began_s = float(begin * unit_s)
    if turn is None:
        return Turn(0.0, 0.0, began_s, began_s + float(np.ptp(since_s)) / 2, unit_s)
    return Turn(turn.turn_s, turn.mid_rad, began_s, began_s + turn.mid_s)


def _delays(times: NDArray[np.generic], turn: Turn) -> Float32:
    """(N,) times after the middle of a sweep [s]; 0 for wild ones."""
    with np.errstate(all="ignore"):
        delay_s = (times.astype(np.float64) - turn.mid_s / turn.unit_s) * turn.unit_s
        wild = ~(np.abs(delay_s) <= turn.mid_s - turn.began_s + MARGIN_S)
    delay_s[wild] = 0.0
    return delay_s.astype(np.float32)


def _fitted(bearing: Float64, since_s: Float64, way: float) -> tuple[Turn | None, float]:
    """Turn of a head that turns clockwise (way 1) or not (-1), None if times do not fit; its residual as a share."""
    first = bearing[since_s <= np.quantile(since_s, FIRST_SHARE)]
    begin_rad = float(np.angle(np.exp(1j * first).mean()))
    turned = np.mod(way * (begin_rad - bearing) + MARGIN_RAD, 2 * np.pi) - MARGIN_RAD
    inside = np.ones(len(turned), bool)
    slope = 0.0
    offset_s = 0.0
    for _ in range(2):  # the second time with the seam where the first fit has it
        if not inside.any():
            return None, np.inf
        slope, offset_s = _line(turned[inside], since_s[inside])
        off_s = np.abs(since_s - offset_s - slope * turned)
        inside = off_s <= MAX_RESIDUAL * 2 * np.pi * abs(slope)
        if not inside.any() or slope <= 0:
            return None, np.inf
        begin = -offset_s / slope - EDGE_RAD
        turned = np.mod(turned - begin, 2 * np.pi) + begin
        off_s = np.abs(since_s - offset_s - slope * turned)
        inside = off_s <= MAX_RESIDUAL * 2 * np.pi * slope
    residual = float(np.quantile(off_s, 0.9)) / max(2 * np.pi * slope, 1e-9)
    if residual > MAX_RESIDUAL:
        return None, residual
    # The middle of what the head has swept by the time of the last point, which is a whole turn or less.
    middle_s = float(since_s[inside].max()) / 2
    return _turned(way, begin_rad, (middle_s - offset_s) / slope, slope, offset_s), residual


def _line(angle_rad: Float64, time_s: Float64) -> tuple[float, float]:
    """Slope [s/rad] and offset [s] of the line that fits times over angles best."""
    centred = angle_rad - angle_rad.mean()
    slope = float(centred @ time_s / max(centred @ centred, 1e-9))
    return slope, float(time_s.mean() - slope * angle_rad.mean())


def _turned(way: float, begin_rad: float, swept: float, slope: float, offset_s: float) -> Turn:
    """Turn of a head that has swept an angle [rad] from its begin to its middle, at a time of `slope` a radian."""
    mid_rad = float(np.angle(np.exp(1j * (begin_rad - way * swept))))
    if abs(mid_rad) < AHEAD_RAD:
        swept += way * mid_rad
        mid_rad = 0.0
    return Turn(way * 2 * np.pi * slope, mid_rad, 0.0, float(offset_s + slope * swept))
