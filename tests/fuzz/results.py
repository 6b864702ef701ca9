"""Views and exports of runs, which the package has written and others may have changed."""

import json

from modt_evaluation.export import FORMS, Export
from modt_evaluation.run_record import RunRecord
from modt_viewer.recorded_run import RecordedRun
from modt_viewer.track_page import rows_of, track_page
from tests.fuzz.runs import DESCRIPTION, described, frame_record
from tests.fuzz.target import of_file, target
from tests.modt_profiling.reporting.test_run_report import ledger_line, window, write_run


def json_lines(records):
    """Records as lines of JSON."""
    return "".join(json.dumps(record) + "\n" for record in records).encode()


@target()
def viewed_run(folder):
    """The view of a run by its ledger and its tracks, with a line `---` between."""
    run = described(write_run(folder / "run", frames=2))
    ledger = run / "ledger.jsonl"
    tracks = run / "tracks.jsonl"
    costs = [ledger_line(k, 1) for k in range(2)]
    seed = [*costs, window(0, costs, 1.5)]

    def call(raw):
        first, _, second = raw.partition(b"---\n")
        ledger.write_bytes(first)
        tracks.write_bytes(second)
        found = RecordedRun.read(run)
        track_page(found, rows_of(found, 3), {})

    return [b"---\n".join([json_lines(seed), json_lines(map(frame_record, range(2)))])], call


@target()
def exported_run(folder):
    """Tracks of a run as a table, and as KITTI's results."""
    run = folder / "run"
    out = folder / "out"
    run.mkdir()
    (run / "run.yaml").write_text(DESCRIPTION + "service: true\n")

    def read():
        recorded = RunRecord.open(run)
        for form in ("csv", "kitti"):
            FORMS[form](Export(recorded, points=False), out)

    return of_file(run / "tracks.jsonl", read, json_lines(map(frame_record, range(2))))
