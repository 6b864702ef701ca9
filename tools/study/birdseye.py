"""A bird's-eye picture of a frame's proposals over its points, as a PNG written with the standard library."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from modt.geometry import corners
from modt.types import NONE, Float32, Int, Proposals

Image = NDArray[np.uint8]
GROUND, RAISED, OUTLINE = (48, 52, 60), (120, 124, 132), (255, 255, 255)


class BirdsEye:
    """A square picture of the plane around the sensor, x upwards.

    Args:
        reach_m: from the middle to each side.
        pixel_m: side of a pixel.
    """

    def __init__(self, reach_m: float = 45.0, pixel_m: float = 0.06) -> None:
        self.reach_m, self.pixel_m = reach_m, pixel_m
        side = int(2 * reach_m / pixel_m)
        self.image: Image = np.full((side, side, 3), 16, np.uint8)

    def dots(self, x: NDArray[np.floating], y: NDArray[np.floating], colour: Image | tuple[int, int, int]) -> None:
        """Paint points of one colour, or of a colour each (n, 3)."""
        row = ((self.reach_m - x) / self.pixel_m).astype(np.int64)
        column = ((self.reach_m - y) / self.pixel_m).astype(np.int64)
        inside = (row >= 0) & (column >= 0) & (row < len(self.image)) & (column < len(self.image))
        paint = np.broadcast_to(np.asarray(colour, np.uint8), (len(x), 3))
        self.image[row[inside], column[inside]] = paint[inside]

    def boxes(self, proposals: Proposals) -> None:
        """Paint the sides of every box."""
        corner = corners(proposals.box)
        along = np.linspace(0, 1, 200)[:, None, None, None]
        line = (corner * (1 - along) + np.roll(corner, -1, axis=1) * along).reshape(-1, 2)
        self.dots(line[:, 0], line[:, 1], OUTLINE)

    def write(self, path: Path) -> None:
        """Write the PNG file."""
        height, width, _ = self.image.shape
        rows = np.concatenate([np.zeros((height, 1), np.uint8), self.image.reshape(height, -1)], axis=1)
        header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
        chunks = [(b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes())), (b"IEND", b"")]
        body = b"".join(
            struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
            for kind, data in chunks
        )
        path.write_bytes(b"\x89PNG\r\n\x1a\n" + body)


def palette(n: int) -> Image:
    """(n, 3) bright colours, neighbours far apart in hue."""
    hue = (np.arange(n) * 0.61803) % 1.0
    wheel = np.abs((hue[:, None] * 6 + np.array([0, 4, 2])) % 6 - 3) - 1
    return (np.clip(wheel, 0, 1) * 170 + 85).astype(np.uint8)


def draw(points: Float32, height: Float32, clearance_m: float, proposals: Proposals, path: Path) -> None:
    """Ground dark, what is raised grey, every proposal in a colour of its own within its box."""
    picture = BirdsEye()
    label: Int = proposals.label(len(points))
    for rows, colour in ((height <= clearance_m, GROUND), (height > clearance_m, RAISED)):
        picture.dots(points[rows, 0], points[rows, 1], colour)
    picture.boxes(proposals)
    mine = label != NONE
    picture.dots(points[mine, 0], points[mine, 1], palette(len(proposals))[label[mine]])
    picture.write(path)
