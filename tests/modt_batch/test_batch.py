"""`modt batch`: one dataset, whoever computes it and however often it is stopped."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("fsspec")
pytest.importorskip("pyarrow")
pytest.importorskip("distributed")

import fsspec
import numpy as np
from pyarrow import dataset as arrow
from pyarrow import parquet

from modt_batch import recording
from modt_batch.dataset import TABLES, Dataset
from modt_batch.recording import MEASURED
from modt_batch.report import mean, worst_first
from modt_simulation.synthetic_stream import SyntheticStream
from tests import recorded
from tests.cli.commands import begin, content, environment, here, modt, refusal
from tests.sources.datasets import Sweep, write_nuscenes

pytestmark = pytest.mark.slow
HERE = Path(__file__).parent
HANGS_S = 300
"""Time after which a command that waits for ever is ended [s]."""
MODES = "conventional,accurate"


@pytest.fixture(scope="module")
def drives(tmp_path_factory):
    """Three short recordings."""
    root = tmp_path_factory.mktemp("drives")
    return [
        recorded.scans(root / f"drive-{seed}", SyntheticStream("street", "vlp-16", 0.4, seed)) for seed in (1, 2, 3)
    ]


def words(drives, out, *options):
    return ("batch", *drives, "--profile", "vlp-16", "--mode", MODES, "--out", out, "--quiet", *options)


def local(drives, out, *options):
    return here(*words(drives, out, "--jobs", 1, "--pages", 0, *options))


@pytest.fixture(scope="module")
def whole(drives, tmp_path_factory):
    """The dataset as one process makes it."""
    out = tmp_path_factory.mktemp("whole") / "dataset"
    assert local(drives, out) == 0
    return out


def contents(out):
    """Tracks by their bytes, and the other tables without what is measured, by file."""
    found = {path.name: path.read_bytes() for path in (out / "tracks").iterdir()}
    for table, measured in MEASURED.items():
        for path in (out / table).iterdir():
            found[f"{table}/{path.name}"] = parquet.read_table(path).drop_columns(list(measured)).to_pydict()
    return found


def test_two_workers_of_a_scheduler_one_of_them_killed_make_the_same_dataset(drives, whole, tmp_path):
    killed = tmp_path / "killed"
    command = [sys.executable, str(HERE / "cluster.py"), str(HERE / "kill_once.py")]
    own = {name: value for name, value in environment().items() if name != "PYTHONWARNINGS"}
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, env={**own, "KILLED": str(killed)}) as cluster:
        address = cluster.stdout.readline().strip()
        done = modt(
            *words(drives, tmp_path / "out", "--scheduler", address, "--pages", 1), cwd=tmp_path, timeout=HANGS_S
        )
        cluster.stdin.close()
    assert done.returncode == 0, done.stderr
    assert killed.exists()
    assert contents(tmp_path / "out") == contents(whole)
    assert len(list((tmp_path / "out" / "pages").iterdir())) == 1
    assert not list((tmp_path / "out").rglob(".*"))


def test_a_stopped_batch_goes_on_and_nothing_is_done_twice_or_missing(drives, whole, tmp_path, monkeypatch):
    out = tmp_path / "out"
    replayed = []
    replay = recording.replay

    def noted(request, *arguments):
        replayed.append((request.path.name, request.mode))
        return replay(request, *arguments)

    monkeypatch.setattr(recording, "replay", noted)
    put = Dataset.put

    def stopped(self, place, content):
        if place.startswith("runs/") and len(replayed) == 3:
            raise KeyboardInterrupt
        put(self, place, content)

    with monkeypatch.context() as stop:
        stop.setattr(Dataset, "put", stopped)
        assert local(drives, out) == 130
    assert len(Dataset(str(out)).committed()) == 2
    assert local(drives, out) == 0
    assert len(replayed) == 3 + 4
    assert len(set(replayed)) == 6
    assert contents(out) == contents(whole)
    assert local(drives, out) == 0
    assert len(replayed) == 7


def committed(out):
    """Names of the runs of a dataset, with the times at which they were written."""
    return {path.name: path.stat().st_mtime_ns for path in (out / "runs").glob("[!.]*")}


def wait_for_a_run(out):
    """Until a run is committed."""
    until_s = time.monotonic() + HANGS_S
    while not committed(out):
        assert time.monotonic() < until_s, "no run is committed"
        time.sleep(0.02)


@pytest.fixture
def interruptible():
    """Processes begun here obey a Ctrl-C, also where the suite is in the background of a script, which ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interruptible")
@pytest.mark.parametrize("jobs", [1, 2])
def test_ctrl_c_keeps_the_runs_that_are_done_and_they_are_not_done_again(drives, whole, tmp_path, capsys, jobs):
    out = tmp_path / "out"
    endless = tmp_path / "endless"  # a recording that is not at its end when the signal comes
    endless.mkdir()
    scan = min(drives[0].iterdir())
    for k in range(5000):
        (endless / f"{k:06d}.bin").symlink_to(scan)
    options = ("--jobs", jobs, "--pages", 0)
    batch = begin(*words([*drives, endless], out, *options), cwd=tmp_path, start_new_session=True)
    try:
        wait_for_a_run(out)
        os.killpg(batch.pid, signal.SIGINT)  # as a terminal does, with the workers among the receivers
        _, errors = batch.communicate(timeout=HANGS_S)
    finally:
        batch.kill()
    assert batch.returncode == 130
    assert "Traceback" not in errors
    before = committed(out)
    assert 1 <= len(before) <= 6
    assert here(*words(drives, out, *options)) == 0
    assert capsys.readouterr().out == ""
    assert contents(out) == contents(whole)
    assert before.items() <= committed(out).items()


def test_paths_may_have_spaces_quotes_and_brackets(drives, tmp_path):
    odd = shutil.copytree(drives[0], tmp_path / """it's a "drive" [1] & <more>""")
    out = tmp_path / """the "out's" place [1]"""
    killed = out / "runs" / ".drive.parquet-0123abcd.part"
    killed.parent.mkdir(parents=True)
    killed.touch()
    assert here(*words([odd], out, "--jobs", 1, "--pages", 1)) == 0
    runs = parquet.read_table(out / "runs").to_pylist()
    assert [(row["address"], row["mode"]) for row in runs] == [(str(odd), "accurate"), (str(odd), "conventional")]
    assert {row["run"] + ".parquet" for row in runs} == set(committed(out))
    (page,) = (out / "pages").iterdir()
    assert f'href="pages/{page.name}"' in (out / "report.html").read_text()
    assert not killed.exists()


def test_a_recording_that_fails_leaves_the_others_and_is_tried_again(drives, whole, tmp_path, capsys):
    broken = tmp_path / "broken"
    broken.mkdir()
    out = tmp_path / "out"
    assert local([broken, *drives], out) == 1
    assert len([line for line in capsys.readouterr().err.splitlines() if "failed: broken-" in line]) == 2
    assert contents(out) == contents(whole)
    recorded.scans(broken, SyntheticStream("street", "vlp-16", 0.2, 4))
    assert local([broken, *drives], out) == 0
    assert len(Dataset(str(out)).committed()) == 8


def test_warnings_name_their_run_and_are_not_repeated_for_its_page(tmp_path, capsys):
    drive = recorded.scans(tmp_path / "drive", SyntheticStream("street", "vlp-16", 0.3, 1))
    first = min(drive.rglob("*.bin"))
    first.write_bytes(first.read_bytes()[:-1])
    assert here("batch", drive, "--out", tmp_path / "out", "--jobs", 1, "--pages", 1, "--quiet") == 0
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "frame skipped" in line]
    assert line.startswith("modt: drive-")


def test_arrow_and_duckdb_read_the_dataset_as_one_table_each(whole):
    duckdb = pytest.importorskip("duckdb")
    for table in TABLES:
        files = [*(whole / table).glob("*.parquet")]
        rows = sum(parquet.read_metadata(file).num_rows for file in files)
        assert len(files) == 6
        assert arrow.dataset(whole / table).count_rows() == rows
        found = duckdb.sql(f"select count(*) from '{whole / table}/*.parquet'").fetchall()
        assert found == [(rows,)]
    joined = (
        f"select distinct mode, stage from '{whole}/ledger/*.parquet' join '{whole}/runs/*.parquet' using (run, mode)"
    )
    assert len(duckdb.sql(joined).fetchall()) == 16


@pytest.mark.parametrize(("place", "names"), [("", ("0001", "0002", "0103")), ("scene-00*", ("0001", "0002"))])
def test_a_data_set_of_nuscenes_stands_for_its_scenes(place, names, tmp_path, capsys):
    root = write_nuscenes(tmp_path / "data", {f"scene-{n}": [sweep_of_dots()] for n in ("0103", "0002", "0001")})
    assert here("batch", root / place, "--out", tmp_path / "out", "--jobs", 1, "--pages", 0, "--quiet") == 0
    runs = arrow.dataset(tmp_path / "out" / "runs").to_table(columns=["stream"])
    assert sorted(runs["stream"].to_pylist()) == [f"scene-{n}" for n in names]
    assert "no scene scene-9*; give one of scene-0001, " in refusal(
        capsys, "batch", root / "scene-9*", "--out", tmp_path / "out"
    )


def sweep_of_dots():
    dots = np.random.default_rng(0).uniform(-20, 20, (60, 4)).astype(np.float32)
    return Sweep(0, dots * (1, 1, 1, 0))


def test_addresses_of_fsspec_are_recordings_and_datasets(drives, whole):
    files = fsspec.filesystem("memory")
    for drive in drives:
        name = drive.name.replace("-", " [") + "]"  # a pattern of fsspec as well
        files.put(str(drive), f"/drives/{name}", recursive=True)
    assert here(*words(["memory://drives/*"], "memory://out", "--jobs", 1, "--pages", 0)) == 0
    tracks = arrow.dataset("/out/tracks", filesystem=files)
    expected = arrow.dataset(whole / "tracks")
    assert tracks.count_rows() == expected.count_rows()
    assert len(tracks.to_table(columns=["run"])["run"].unique()) == 6
    assert files.exists("/out/report.html")


def test_a_dataset_of_another_request_is_refused(drives, whole, capsys):
    line = refusal(capsys, *words(drives, whole, "--frames", "0:2"))
    assert "was made with another frames" in line


@pytest.mark.parametrize(
    ("arguments", "cause"),
    [
        (("gone", "--out", "out"), "gone: does not exist"),
        (("memory://nothing/*", "--out", "out"), "matches nothing"),
        (("gone", "--out", "no-such://a"), "cannot be opened"),
    ],
)
def test_what_cannot_be_run_is_refused(arguments, cause, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cause in refusal(capsys, "batch", *arguments)


THREADS = """
from modt.cli.main import main
main(["batch", "gone", "--out", "out"])
import pyarrow
print(pyarrow.cpu_count())
"""


def test_arrow_has_one_thread_whatever_the_number_of_cores(tmp_path):
    options = {"cwd": tmp_path, "env": environment(), "capture_output": True, "text": True, "timeout": HANGS_S}
    done = subprocess.run([sys.executable, "-c", THREADS], check=False, **options)
    assert (done.returncode, done.stdout) == (0, "1\n"), done.stderr


def test_a_missing_extra_is_named(tmp_path, monkeypatch, capsys, drives):
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert "pip install '.[batch]'" in refusal(capsys, *words(drives, tmp_path / "out", "--jobs", 2))


def test_a_page_and_a_report_lead_from_the_figures_to_the_worst_run(drives, tmp_path, capsys):
    out = tmp_path / "out"
    options = ("--profile", "vlp-16", "--mode", MODES, "--jobs", 1, "--pages", 1, "--frames", "0:2")
    assert here("batch", *drives, *options, "--out", out) == 0
    text = capsys.readouterr().out
    assert "3 recordings, 6 runs, 12 frames" in text
    assert "gamma, accurate" in text
    (page,) = (out / "pages").iterdir()
    assert f'href="pages/{page.name}"' in (out / "report.html").read_text()
    assert content(out / "batch.json")["frames"] == [0, 2]


def test_means_have_intervals_over_the_recordings():
    found = mean([2.0, 3.0, 4.0])
    assert (found.value, round(found.low, 3), round(found.high, 3)) == (3.0, 0.516, 5.484)
    assert mean([1.0, 2.0, 3.0]).low == 0.0
    assert mean([90.0, 99.0, 100.0], "%").high == 100.0
    assert mean([1.0]).low is None
    assert mean([None, float("nan")]).value is None


def test_the_worst_run_is_the_least_trusted_then_the_slowest():
    row = {"frames": 10, "frames_good": 10, "left_out": 0, "cpu_ms_p99": 5.0}
    rows = [
        {**row, "run": "fast"},
        {**row, "run": "slow", "cpu_ms_p99": 9.0},
        {**row, "run": "unread", "left_out": 1},
        {**row, "run": "blind", "frames_good": 2},
    ]
    assert [row["run"] for row in worst_first(rows)] == ["blind", "unread", "slow", "fast"]
