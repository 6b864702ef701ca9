"""How to add a sink (docs/extending.md): an object with write and close."""

import csv

from modt.app import assembly
from modt.app.loop import FullSpeed, Stop, drive
from modt.classes import CLASS_NAMES
from modt.energy.ledger import Ledger
from modt.geometry import FieldOfView
from modt.profile import load
from modt.sinks.output import LineFile
from modt.types import UNLIMITED, FrameResult
from modt_desk.simulation.synthetic_stream import SyntheticStream


class ObjectTable(LineFile[FrameResult]):
    """A CSV file: a line for each track with a proposal."""

    def __init__(self, path):
        super().__init__(path, self.lines)

    @staticmethod
    def lines(result: FrameResult) -> str:
        tracks = result.tracks
        rows = (tracks.proposal >= 0).nonzero()[0].tolist()
        return "".join(f"{result.frame.index},{tracks.id[k]},{CLASS_NAMES[tracks.object_class[k]]}\n" for k in rows)


class Lines(list):
    """Ledger lines, kept."""

    write = list.append

    def close(self):
        pass


def test_the_loop_writes_every_frame_to_the_sink_and_books_it(tmp_path):
    profile = load("vlp-16")
    pipeline = assembly.pipeline(assembly.MODES["efficient"], profile, FieldOfView(), Ledger())
    sink, ledger = ObjectTable(tmp_path / "objects.csv"), Lines()
    results = []
    stream = SyntheticStream("street", "vlp-16", 0.5, seed=0)
    drive(stream, pipeline, [sink], ledger, UNLIMITED, FullSpeed(), Stop(), lambda result, _: results.append(result))
    sink.close()
    rows = list(csv.reader((tmp_path / "objects.csv").read_text().splitlines()))
    assert {int(frame) for frame, _, _ in rows} == set(range(5))
    assert len(rows) == sum(len(result.proposals) for result in results)
    assert all(line["stages"]["sink"]["calls"] == 1 for line in ledger)
