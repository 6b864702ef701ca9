"""The points beside the frames of a run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from modt.sources.stream import Stream
from modt.viewer.point_cells import Cells, Grid
from modt_desk.evaluation.frames_by_number import FramesByNumber

NO_CELLS = Cells(np.zeros(0, np.int64), np.zeros(0, np.int64))


def sweeps(numbers: Sequence[int], stream: Stream, grid: Grid, most: int) -> Iterator[Cells]:
    """Cells of each frame, by ascending number, at most so many; none where the stream lacks the frame."""
    frames = FramesByNumber(stream.between(0, numbers[-1] + 1))
    for number in numbers:
        frame = frames.get(number)
        yield NO_CELLS if frame is None else grid.cells(frame.points).thinned(most)
