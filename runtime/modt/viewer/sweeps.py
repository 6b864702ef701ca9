"""The points beside the frames of a run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from modt.sources.stream import Stream
from modt.viewer.point_cells import Cells, Grid

NO_CELLS = Cells(np.zeros(0, np.int64), np.zeros(0, np.int64))


def sweeps(numbers: Sequence[int], stream: Stream, grid: Grid, most: int) -> Iterator[Cells]:
    """Cells of each frame, by ascending number, at most so many; none where the stream lacks the frame."""
    frames = iter(stream.between(numbers[0], numbers[-1] + 1))
    frame = next(frames, None)
    for number in numbers:
        while frame is not None and frame.index < number:
            frame = next(frames, None)
        if frame is None or frame.index > number:
            yield NO_CELLS
        else:
            yield grid.cells(frame.points).thinned(most)
