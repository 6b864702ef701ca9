"""Each kind of call that a service makes fails once; `python -m tools.faults` fails thousands, alone and in pairs."""

import pytest

from tests.crash.faulty_run import FaultyRun

DISK = (
    "open status.json",
    "fsync run.yaml",
    "write tracks.jsonl",
    "mkdir run",
    "fsync ledger.jsonl",
    "fstat tracks.jsonl",
)
KINDS = (*DISK, "recvmsg AF_INET", "sendto AF_UNIX", "calendar", "monotonic", "meter", "listdir task", "open statm")


@pytest.fixture(name="calls", scope="module")
def calls_without_faults(tmp_path_factory):
    run = FaultyRun(tmp_path_factory.mktemp("clean"), {})
    run.run()
    run.check()
    assert run.service.recording.health().lost_lines == 0
    assert len(run.frames) >= 35
    return run.faults.calls


@pytest.mark.slow
@pytest.mark.parametrize("name", KINDS)
def test_a_failing_call_ends_nothing_and_what_it_costs_is_counted(calls, name, tmp_path):
    kind, _, of = name.partition(" ")
    at = [k for k, call in enumerate(calls) if call.partition(" ")[0] == kind and of in call]
    assert at, "no such call"
    for n, (k, lasting_s) in enumerate(((at[0], 0.0), (at[-1], 2.0))):
        folder = tmp_path / str(n)
        folder.mkdir()
        run = FaultyRun(folder, {k: 7 * n + 1}, lasting_s)
        run.run()
        run.check()
