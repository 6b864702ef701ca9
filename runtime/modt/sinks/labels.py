"""Point labels in SemanticKITTI's encoding: which proposal and class each point of the input scan belongs to."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from modt.sinks.output import writing
from modt.types import NONE, FrameResult

HIGHEST = 0xFFFF


class PointLabels:
    """Writes NNNNNN.label, one u32 a point in the order of the input scan.

    The upper 16 bits hold the proposal's number in the frame plus one (0: none), the lower 16 bits the class of the
    track that owns it.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        with writing(folder):
            folder.mkdir(parents=True, exist_ok=True)

    def write(self, result: FrameResult) -> None:
        """Write one frame's file.

        Raises:
            ModtError: the file cannot be written.
        """
        path = self._folder / f"{result.frame.index:06d}.label"
        with writing(path):
            path.write_bytes(encode(result).tobytes())

    def close(self) -> None:
        """Nothing stays open."""


def encode(result: FrameResult) -> np.ndarray[tuple[int], np.dtype[np.uint32]]:
    """(N,) label of each point of the frame."""
    rows = result.tracks.row_of_proposal(len(result.proposals))
    classes = result.tracks.object_class[rows]
    code = np.minimum(np.arange(len(rows)) + 1, HIGHEST) << 16 | np.where(rows == NONE, 0, classes)
    out = np.zeros(len(result.frame.points), np.uint32)
    out[result.proposals.members] = np.repeat(code, result.proposals.count).astype(np.uint32)
    return out
