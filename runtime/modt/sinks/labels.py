"""Point labels in SemanticKITTI's format: proposal and class of each point of the input scan."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from modt.classes import CLASSES
from modt.sinks.output import Health, writing
from modt.types import NONE, FrameResult

MAX_INSTANCE = 0xFFFF
SEMANTIC = np.array([(*spec.semantic_kitti, 0)[0] for spec in CLASSES.values()])
"""SemanticKITTI's label of each class, 0 (unlabelled) for the background."""


class PointLabels:
    """Writes NNNNNN.label, one u32 per point in the order of the input scan.

    Upper 16 bits: index of the proposal in the frame plus one, 0 for none. Lower 16 bits: class of its track.
    """

    def __init__(self, folder: Path) -> None:
        self._folder, self._written = folder, 0
        with writing(folder):
            folder.mkdir(parents=True, exist_ok=True)

    def write(self, result: FrameResult) -> None:
        """Write one frame's file.

        Raises:
            ModtError: the file cannot be written.
        """
        self.write_labels(result.frame.index, encode(result))

    def write_labels(self, index: int, labels: NDArray[np.uint32]) -> None:
        """Write the file of a frame from its labels (N,).

        Raises:
            ModtError: the file cannot be written.
        """
        path = self._folder / f"{index:06d}.label"
        with writing(path):
            path.write_bytes(labels.tobytes())
        self._written += 1

    def health(self) -> Health:
        """Number of files written."""
        return {"written": self._written}

    def close(self) -> None:
        """No effect: no file stays open."""


def encode(result: FrameResult) -> np.ndarray[tuple[int], np.dtype[np.uint32]]:
    """(N,) label of each point of the frame."""
    rows = result.tracks.row_of_proposal(len(result.proposals))
    classes = result.tracks.object_class[rows]
    code = np.minimum(np.arange(len(rows)) + 1, MAX_INSTANCE) << 16 | np.where(rows == NONE, 0, classes)
    out = np.zeros(len(result.frame.points), np.uint32)
    out[result.proposals.members] = np.repeat(code, result.proposals.count).astype(np.uint32)
    return out
