"""`modt run` from the outside: a recording as a live source, signals, records, and messages to systemd."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from modt import profile
from modt.sinks.tracks import SCHEMA
from modt_commands.profile import main as modt_profile
from modt_profiling.reporting.records import read_records
from modt_simulation.synthetic_stream import SyntheticStream
from tests import recorded

from .commands import begin, content, environment, here, modt, refusal, succeeded

pytestmark = pytest.mark.command

DEADLINE_S = 60.0


@pytest.fixture(scope="module")
def scans(tmp_path_factory):
    """Fifteen scans of a small sensor."""
    return recorded.scans(tmp_path_factory.mktemp("scans"), SyntheticStream("street", "vlp-16", 1.5, 0))


class Service:
    """A running `modt run`, and the socket that it notifies."""

    def __init__(self, folder, *arguments, watchdog_s=2.0):
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(str(folder / "notify"))
        self.socket.settimeout(DEADLINE_S)
        self.out = folder / "run"
        notified = {"NOTIFY_SOCKET": str(folder / "notify"), "WATCHDOG_USEC": str(round(1e6 * watchdog_s))}
        self.process = begin("run", *arguments, "--out", self.out, cwd=folder, env={**environment(), **notified})

    def hear(self, beginning):
        """The next message that begins with some word; without one the test fails with what the service said."""
        try:
            while not (message := self.socket.recv(4096).decode()).startswith(beginning):
                pass
        except TimeoutError:
            status = self.process.poll()
            self.process.kill()
            pytest.fail(f"no {beginning} from a service of status {status}: {self.process.communicate()[1]}")
        return message

    def end(self):
        """Status and messages; the test fails if it goes on."""
        self.process.terminate()
        _, said = self.process.communicate(timeout=DEADLINE_S)
        return self.process.returncode, said

    def close(self):
        self.socket.close()
        self.process.kill()
        if not self.process.stderr.closed:
            self.process.communicate()


@pytest.fixture
def start(scans, tmp_path):
    """Start a service on the scans in a loop, and wait until it is ready."""
    made = []

    def started(*options, ready=True):
        options = options or ("--profile", "vlp-16")
        made.append(Service(tmp_path, f"{scans}?loop=yes", *options))
        if ready:
            made[0].hear("READY=1")
        return made[0]

    yield started
    for service in made:
        service.close()


def test_a_recording_runs_to_its_end_with_every_sweep_recorded(scans, tmp_path):
    succeeded("run", scans, "--out", tmp_path / "run", "--metrics", tmp_path / "modt.prom", cwd=tmp_path)
    names = {p.name for p in (tmp_path / "run").iterdir()}
    assert names == {"run.yaml", "tracks.jsonl", "ledger.jsonl", "summary.json", "status.json"}
    status = content(tmp_path / "run/status.json")
    frames = [r["frame"] for r in read_records(tmp_path / "run" / "tracks.jsonl", SCHEMA)]
    sensor = status["sensor"]
    assert sensor["sweeps"] == 15
    assert len(frames) == status["counts"]["frames"]
    left_out = sensor["dropped_sweeps"] + status["loop"]["shed_sweeps"] + sensor["faults"]  # on a busy machine
    assert len(frames) + left_out == 15
    described = content(tmp_path / "run/run.yaml")
    assert described["service"] is True
    assert described["recognition"]["used"] == "as found"
    assert "modt_counts_frames_total" in (tmp_path / "modt.prom").read_text()
    page = tmp_path / "page.html"
    assert here("report", tmp_path / "run", "--html", page, program=modt_profile) == 0
    assert "<h3>Lateness</h3>" in page.read_text()
    pytest.importorskip("foxglove")
    assert here("export", tmp_path / "run", "--mcap", tmp_path / "run.mcap") == 0
    assert (tmp_path / "run.mcap").stat().st_size > len(frames) * 100_000  # with the points


def test_a_reload_before_it_is_ready_does_not_end_it(start):
    service = start(ready=False)
    status = Path(f"/proc/{service.process.pid}/status")
    hup = 1 << (signal.SIGHUP - 1)
    ignored = False
    while not ignored:
        ignored, handled = (
            bool(int(mask, 16) & hup) for mask in re.findall(r"Sig(?:Ign|Cgt):\t(\w+)", status.read_text())
        )
        assert not handled
    service.process.send_signal(signal.SIGHUP)
    service.hear("READY=1")
    assert service.end()[0] == 0


def test_systemd_is_notified_of_each_state_and_of_a_reload(start, tmp_path):
    own = tmp_path / "robot.yaml"
    own.write_text(profile.to_yaml(profile.dump(profile.load("vlp-16"))))
    service = start("--profile", own)
    service.hear("WATCHDOG=1")
    assert "tracks" in service.hear("STATUS=")
    for before, after in (("all", "everything"), ("everything", "all")):
        own.write_text(own.read_text().replace(f"keep: {before}", f"keep: {after}"))
        service.process.send_signal(signal.SIGHUP)
        assert "MONOTONIC_USEC=" in service.hear("RELOADING=1")
        service.hear("READY=1")
        service.hear("STATUS=")
    status, said = service.end()
    assert status == 0
    assert service.hear("STOPPING=1")
    assert "keep" in said
    loop = content(service.out / "status.json")["loop"]
    assert (loop["reloads"], loop["refused_reloads"]) == (1, 1)


@pytest.mark.parametrize(("options", "hosts"), [([], []), (["--view", ":0"], ["127.0.0.1"])])
def test_nothing_listens_but_the_page_that_is_asked_for_and_none_beyond_this_machine(start, options, hosts):
    service = start("--profile", "vlp-16", *options)
    process = psutil.Process(service.process.pid)
    assert process.children() == []
    opened = getattr(process, "net_connections", None) or process.connections  # the name before psutil 6
    assert [(found.status, found.laddr.ip) for found in opened("inet")] == [("LISTEN", host) for host in hosts]
    assert [found for found in opened("unix") if found.laddr] == []
    assert service.end()[0] == 0


def test_the_run_is_seen_in_a_browser_while_it_goes_on(start, chromium):
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    service = start("--profile", "vlp-16", "--view", f"127.0.0.1:{port}")
    with chromium.tab(f"http://127.0.0.1:{port}/", width=390) as tab:
        tab.until("state.at > 3 && state.at === last && drawn.length > 10")
        assert tab.value("new Int32Array(image.data.buffer).some((value) => value !== colours.paperPixel)")
        tab.value("slider.value = 1; slider.dispatchEvent(new Event('input'))")
        before = tab.value("last")
        tab.until(f"last > {before} + 2")
        assert tab.value("[state.at, canvas.dataset.frame === String(frames[1].frame)]") == [1, True]
        tab.until("notice.textContent.includes('profile vlp-16, mode accurate')")
        assert "modt_counts_frames_total" in tab.value("fetch('metrics').then((answer) => answer.text())")
        story = "(state.kept = rowsAt[1][0].id, showStory(), element('story').innerText)"
        assert "mJ" not in tab.value(story)  # what a track cost is known afterwards
        tab.press("End")
        tab.until(f"state.at > {before}")
    assert service.end()[0] == 0
    sink = content(service.out / "status.json")["sinks"][f"view://127.0.0.1:{port}"]
    assert (sink["failed"], sink["state"]) == (0, "ok")


def test_a_killed_service_has_lost_no_more_than_a_second_and_starts_again(scans, start, tmp_path):
    service = start()
    while not (service.out / "tracks.jsonl").exists() or len((service.out / "tracks.jsonl").read_bytes()) < 100_000:
        service.hear("STATUS=")
    service.process.kill()
    service.process.communicate()
    frames = list(read_records(service.out / "tracks.jsonl", SCHEMA))
    assert len(frames) > 5
    succeeded("run", scans, "--out", service.out, cwd=tmp_path)
    assert len(list(read_records(tmp_path / "run~1" / "tracks.jsonl", SCHEMA))) == len(frames)


@pytest.mark.parametrize("source", ["nowhere", "nowhere?loop=maybe", "nowhere?speed=2"])
def test_a_source_that_cannot_be_is_a_misuse(source, capsys):
    assert "nowhere" in refusal(capsys, "run", source)


def test_the_status_of_a_service_while_it_runs_and_after(scans, start, tmp_path, capsys):
    assert refusal(capsys, "status", tmp_path / "run")
    service = start()
    while not (service.out / "status.json").exists():
        service.hear("STATUS=")
    second = modt("run", scans, "--out", service.out, cwd=tmp_path)
    assert second.returncode == 1
    assert "another run of modt records into it; end it" in second.stderr
    assert here("status", service.out) == 0
    assert "running for" in capsys.readouterr().out
    assert here("status", service.out, "--json") == 0
    assert json.loads(capsys.readouterr().out)["pid"] == service.process.pid
    assert service.end()[0] == 0
    path = service.out / "status.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"time_s": time.time() - 60}))
    assert here("status", service.out) == 1
    assert "NOT running" in capsys.readouterr().out


def test_check_names_each_shortcoming_with_its_remedy_and_fails_without_a_sensor(scans, tmp_path):
    done = modt("check", scans, "--profile", "vlp-16", "--out", tmp_path / "run", cwd=tmp_path)
    lines = done.stdout.splitlines()
    assert done.returncode == 0, done.stdout + done.stderr
    assert {line.split(":")[0].split()[1] for line in lines} >= {"core", "governor", "meters", "model", "sensor"}
    assert all("; " in line for line in lines if line.startswith(("warn", "fail")))
    lost = modt("check", tmp_path / "nowhere", cwd=tmp_path)
    assert lost.returncode == 1
    assert "fail  sensor" in lost.stdout


def test_a_power_limit_is_kept_and_named_an_estimate_where_it_is_one(start, tmp_path):
    own = tmp_path / "robot.yaml"
    own.write_text("extends: vlp-16\nloop: {power_W: 0.5}\n")
    service = start("--profile", own)
    path = service.out / "status.json"
    for _ in range(60):  # the first window of energy ends after a second or more, however busy the machine is
        service.hear("STATUS=")
        status = json.loads(path.read_text()) if path.exists() else None
        if status and status["power"]["windows"] and "deferred" in status["loop"]["steps_entered"]:
            break
    else:
        pytest.fail("no classification was deferred")
    code, said = service.end()
    assert code == 0, said
    assert status["power"]["watts"] > status["power"]["limit_W"]  # the board idles at 3 W
    if status["power"]["kind"] == "estimated":
        assert "loop.power_W is kept by the model" in said
    if "(the result came after its deadline)" not in said:  # a busy machine may have shed load by time before
        assert "(more power than the limit)" in said


@pytest.mark.parametrize(("out", "cause"), [("file/run", "Not a directory"), ("others", "holds lost+found")])
def test_where_nothing_can_be_recorded_the_loop_goes_on_and_the_end_says_so(scans, tmp_path, out, cause):
    (tmp_path / "file").write_text("")
    (tmp_path / "others" / "lost+found").mkdir(parents=True)
    metrics = tmp_path / "missing" / "modt.prom"
    done = succeeded("run", scans, "--out", tmp_path / out, "--metrics", metrics, cwd=tmp_path)
    assert "Traceback" not in done.stderr
    assert "nothing is recorded, " in done.stderr.splitlines()[-1]
    assert cause in done.stderr.splitlines()[-1]
    assert f"metrics: {metrics}" in done.stderr


def test_a_log_that_nobody_reads_stops_neither_the_loop_nor_its_end(scans, tmp_path):
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    with suppress(BlockingIOError):
        while True:
            os.write(writer, b"x")
    os.set_blocking(writer, True)
    command = [sys.executable, "-m", "modt.cli.main", "run", f"{scans}?loop=yes", "--out", tmp_path / "run"]
    with subprocess.Popen(command, stderr=writer, env=environment()) as process:
        try:
            path = tmp_path / "run" / "tracks.jsonl"
            ends_s = time.monotonic() + DEADLINE_S
            while not (path.exists() and path.stat().st_size):
                assert time.monotonic() < ends_s, "nothing is recorded"
                time.sleep(0.05)
            process.terminate()
            assert process.wait(DEADLINE_S) == 0
        finally:
            process.kill()
    os.close(reader)
    os.close(writer)
    assert content(tmp_path / "run/summary.json")["frames"]
