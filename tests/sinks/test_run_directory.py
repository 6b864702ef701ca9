"""The run directory: no earlier result is lost."""

import pytest

from modt.errors import MisuseError, ModtError
from modt.sinks.run_directory import RunDirectory
from tests.results import result


def test_a_new_directory_is_created_with_its_parents(tmp_path):
    directory = RunDirectory(tmp_path / "a" / "b")
    directory.describe("x: 1\n")
    directory.summarise({"frames": 3})
    assert sorted(p.name for p in directory.path.iterdir()) == ["run.yaml", "summary.json"]
    assert directory.kept is None


def test_an_earlier_run_is_kept(tmp_path):
    for n in range(3):
        lines = RunDirectory(tmp_path / "run").tracks()
        lines.write(result(n, [], {}))
        lines.close()
    kept = sorted(p.name for p in tmp_path.iterdir())
    assert kept == ["run", "run~1", "run~2"]


@pytest.mark.parametrize("kind", ["file", "foreign"])
def test_a_path_that_is_no_run_is_not_touched(tmp_path, kind):
    out = tmp_path / "out"
    if kind == "file":
        out.write_text("mine")
    else:
        out.mkdir()
        (out / "thesis.tex").write_text("mine")
    with pytest.raises(MisuseError, match=r"--out|directory"):
        RunDirectory(out)
    kept = out if kind == "file" else out / "thesis.tex"
    assert kept.read_text() == "mine"


def test_a_path_that_cannot_be_written_is_an_error():
    from pathlib import Path

    with pytest.raises(ModtError, match="cannot be written"):
        RunDirectory(Path("/proc/modt-run"))
