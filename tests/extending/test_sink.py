"""How to add a sink (docs/extending.md): an object with write and close."""

import csv

import pytest

from modt.app.build import replay
from modt.app.inputs import Request
from modt.app.systemd import Notifier
from modt.classes import CLASS_NAMES
from modt.sinks.output import LineFile
from modt.types import FrameResult


class ObjectTable(LineFile[FrameResult]):
    """A CSV file: a line for each track with a proposal."""

    def __init__(self, path):
        super().__init__(path, self.lines)

    @staticmethod
    def lines(result: FrameResult) -> str:
        tracks = result.tracks
        rows = (tracks.proposal >= 0).nonzero()[0].tolist()
        return "".join(f"{result.frame.index},{tracks.id[k]},{CLASS_NAMES[tracks.object_class[k]]}\n" for k in rows)


@pytest.mark.slow
def test_a_replay_writes_every_frame_to_the_sink_and_books_it(tmp_path):
    sink = ObjectTable(tmp_path / "objects.csv")
    results = []
    request = Request(profile=["vlp-16"], mode="efficient", frames=(0, 5))
    loop = replay(request, {"objects": sink}, tmp_path / "run", None, ["test"])
    summary = loop.run(Notifier(), results.append)
    rows = list(csv.reader((tmp_path / "objects.csv").read_text().splitlines()))
    assert {int(frame) for frame, _, _ in rows} == set(range(5))
    assert len(rows) == sum(len(result.proposals) for result in results)
    assert summary["sinks"] == {"objects": {"written": 5}}
    assert summary["stages"]["sink"]["calls"] == 10  # and the records
