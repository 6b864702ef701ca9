"""Point-cloud files for tests."""

import struct

import numpy as np

PCD = {"f4": "F", "f8": "F", "u1": "U", "u2": "U", "u4": "U", "i4": "I"}
PLY = {"f4": "float", "f8": "double", "u1": "uchar", "u2": "ushort", "i4": "int"}


def table(**kinds):
    """Five points; reflectance and others count up."""
    rows = np.zeros(5, list(kinds.items()))
    for i, name in enumerate(kinds):
        rows[name] = np.arange(5) * (1 if name in "xyz" else 50) + i
    return rows


def text(rows):
    return "\n".join(" ".join(str(v) for v in row.tolist()) for row in rows).encode()


def literal(data):
    """LZF that compresses nothing."""
    return b"".join(bytes([len(data[i : i + 32]) - 1]) + data[i : i + 32] for i in range(0, len(data), 32))


def pcd(rows, data="binary", **lines):
    kinds = [rows.dtype[name].str[1:] for name in rows.dtype.names]
    head = {
        "VERSION": "0.7",
        "FIELDS": " ".join(rows.dtype.names),
        "SIZE": " ".join(kind[1:] for kind in kinds),
        "TYPE": " ".join(PCD[kind] for kind in kinds),
        "COUNT": " ".join("1" for _ in kinds),
        "WIDTH": len(rows),
        "HEIGHT": 1,
        "VIEWPOINT": "0 0 0 1 0 0 0",
        "POINTS": len(rows),
        "DATA": data,
    } | lines
    columns = b"".join(rows[name].tobytes() for name in rows.dtype.names)
    packed = struct.pack("<II", len(literal(columns)), len(columns)) + literal(columns)
    body = {"binary": rows.tobytes(), "ascii": text(rows), "binary_compressed": packed}.get(data, b"")
    lines_ = [f"{key} {value}" for key, value in head.items() if value is not None]
    return "\n".join(["# .PCD v0.7", *lines_, ""]).encode() + body


def ply(rows, data="binary_little_endian", before="", n=None):
    properties = "".join(f"property {PLY[rows.dtype[name].str[1:]]} {name}\n" for name in rows.dtype.names)
    count = len(rows) if n is None else n
    head = f"ply\nformat {data} 1.0\ncomment by a test\n{before}element vertex {count}\n{properties}"
    in_order = rows.astype(rows.dtype.newbyteorder(">" if "big" in data else "<"))
    body = text(rows) if data == "ascii" else in_order.tobytes()
    return f"{head}element face 0\nproperty list uchar int vertex_indices\nend_header\n".encode() + body
