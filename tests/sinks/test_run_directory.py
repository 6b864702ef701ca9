"""The run directory: no earlier run is lost, half-made ones are no obstacle, nothing else is touched."""

import shutil
from contextlib import ExitStack

import pytest

from modt.errors import ModtError
from modt.sinks.run_directory import STATUS, RunDirectory
from tests.sinks.recordings import OURS


def begun(path, limit_bytes=1e9):
    directory = RunDirectory(path)
    directory.begin(OURS, limit_bytes)
    return directory


def fill(path, size=1000):
    (path / "tracks.jsonl").write_bytes(b"x" * size)


def names(folder):
    return sorted(p.name for p in folder.iterdir())


@pytest.mark.parametrize(
    "left", [[], [".run.yaml.part"], ["run.yaml"], ["run.yaml", "status.json"], [".status.json.part"]]
)
def test_a_half_made_directory_is_made_anew(tmp_path, left):
    run = tmp_path / "run"
    run.mkdir()
    for name in left:
        (run / name).write_text("half")
    begun(run)
    assert names(tmp_path) == ["run"]
    assert names(run) == ["run.yaml"]
    assert (run / "run.yaml").read_text() == OURS


def test_each_part_is_kept_under_the_next_number_and_the_oldest_go_first(tmp_path):
    for k in range(13):
        directory = begun(tmp_path / "run", 2500)
        assert directory.previous == (tmp_path / f"run~{k}" if k else None)
        fill(directory.path, 1000 + k)
    assert names(tmp_path) == ["run", "run~11", "run~12"]
    assert (tmp_path / "run~11" / "tracks.jsonl").stat().st_size == 1010
    assert not (tmp_path / "run~11" / STATUS).exists()


def test_nothing_but_records_of_a_service_is_deleted(tmp_path):
    replay = tmp_path / "run~1"
    notes = tmp_path / "run~2"
    foreign = tmp_path / "run~3"
    for folder in (replay, notes, foreign):
        folder.mkdir()
        fill(folder, 5000)
    (replay / "run.yaml").write_text("schema: modt.run/1\ncommand: [modt, replay]\n")
    (foreign / "run.yaml").write_text(OURS)
    (foreign / "thesis.tex").write_text("mine")
    begun(tmp_path / "run", 0.0)
    assert names(tmp_path) == ["run", "run~1", "run~2", "run~3"]
    assert (replay / "tracks.jsonl").stat().st_size == 5000
    assert (notes / "tracks.jsonl").stat().st_size == 5000
    assert names(foreign) == ["thesis.tex"]


def test_a_path_that_is_no_run_is_refused(tmp_path):
    (tmp_path / "thesis.tex").write_text("mine")
    for out in (tmp_path, tmp_path / "thesis.tex"):
        directory = RunDirectory(out)
        with pytest.raises(ModtError, match="give "):
            directory.begin(OURS, 1e9)
    assert (tmp_path / "thesis.tex").read_text() == "mine"


@pytest.mark.parametrize("first", ["the run that is in", "another one"])
def test_the_lock_outlasts_the_removal_of_the_folder_around_the_run(tmp_path, first, monkeypatch):
    monkeypatch.setattr("modt.sinks.run_directory.MEMORY", tmp_path)
    run, other = (RunDirectory(tmp_path / "state" / "run") for _ in range(2))
    with run.locked(), ExitStack() as stack:
        run.begin(OURS, 1e9)
        shutil.rmtree(tmp_path / "state")
        if first == "another one":
            stack.enter_context(other.locked())
            other.begin(OURS, 1e9)
            fill(other.path)
            for _ in range(2):
                with pytest.raises(ModtError, match="another run of modt records into it"):
                    run.begin(OURS, 1e9)
            assert names(tmp_path / "state" / "run") == ["run.yaml", "tracks.jsonl"]
            run.in_memory("status")
            assert names(tmp_path) == ["state"]
            stack.close()
        run.begin(OURS, 1e9)
        with pytest.raises(ModtError, match="another run of modt records into it"):
            other.locked().__enter__()


def test_no_lock_stays_beside_a_run_that_has_ended_and_none_is_removed_from_another(tmp_path):
    run = RunDirectory(tmp_path / "run")
    with run.locked():
        run.begin("schema: modt.run/1\n", 1e9)
        other = RunDirectory(tmp_path / "run")
        with pytest.raises(ModtError, match="another run"):
            other.locked().__enter__()
        assert (tmp_path / ".run.lock").exists()
    assert [path.name for path in tmp_path.iterdir()] == ["run"]
    with run.locked(), pytest.raises(ModtError, match="another run"):
        other.locked().__enter__()


def test_where_no_lock_can_be_written_the_service_goes_on_and_the_disk_is_to_blame(tmp_path):
    (tmp_path / "file").write_text("")
    directory = RunDirectory(tmp_path / "file" / "run")
    with directory.locked(), pytest.raises(ModtError, match="cannot be written"):
        directory.begin(OURS, 1e9)
