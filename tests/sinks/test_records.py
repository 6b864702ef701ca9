"""JSON Lines: complete lines, read back as written."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.errors import MisuseError, ModtError
from modt.sinks.output import LineFile
from modt.sinks.records import line
from modt_profiling.reporting.records import read_records
from tests.sinks.recordings import files_of_at_most


@given(cut=st.integers(0, 200))
def test_a_truncated_file_keeps_its_complete_lines(tmp_path_factory, cut):
    path = tmp_path_factory.getbasetemp() / "cut.jsonl"
    lines = LineFile(path, line)
    for i in range(6):
        lines.write({"schema": "s/1", "i": i, "text": "x" * i})
    lines.close()
    content = path.read_bytes()[:cut]
    path.write_bytes(content)
    whole = content.count(b"\n")
    read = [r["i"] for r in read_records(path, "s/1")]
    assert read[:whole] == list(range(whole))
    assert len(read) <= whole + 1  # the last line may lack its newline alone


@pytest.mark.parametrize(
    ("content", "where"),
    [
        ('{"schema":"s/1"}\nnonsense\n', ":2: no JSON"),
        ('{"schema":"s/2"}\n', ":1: schema is 's/2'"),
        ("[1]\n", ":1: schema is None"),
        (None, "cannot be read"),
    ],
)
def test_an_invalid_record_is_refused_with_its_line_and_a_missing_file(tmp_path, content, where):
    path = tmp_path / "r.jsonl"
    if content is not None:
        path.write_text(content)
    with pytest.raises(MisuseError, match=where):
        list(read_records(path, "s/1"))


def test_a_line_that_does_not_fit_or_cannot_be_read_again_is_not_written(tmp_path):
    path = tmp_path / "r.jsonl"
    lines = LineFile(path, line)
    with pytest.raises(ValueError, match="JSON"):
        lines.write({"x": float("nan")})
    with files_of_at_most(1000), pytest.raises(ModtError, match="too large"):
        any(lines.write({"schema": "s/1", "i": i, "fill": "x" * 90}) for i in range(100))
    lines.write({"schema": "s/1", "i": "later"})
    lines.close()
    read = [r["i"] for r in read_records(path, "s/1")]
    assert read == [*range(len(read) - 1), "later"]
    assert len(read) >= 5


def test_records_of_ignored_schemas_are_skipped(tmp_path):
    path = tmp_path / "mixed.jsonl"
    path.write_text("".join(line({"schema": f"{kind}/1", "n": n}) for n in range(3) for kind in ("ledger", "energy")))
    for kind, other in (("ledger", "energy"), ("energy", "ledger")):
        assert [r["n"] for r in read_records(path, f"{kind}/1", ignored={f"{other}/1"})] == [0, 1, 2]
    with pytest.raises(MisuseError, match=r"mixed\.jsonl:2"):
        list(read_records(path, "ledger/1"))
