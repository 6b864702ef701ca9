"""Cores of the loop and of what serves it."""

import os
import subprocess
import sys
import threading
from pathlib import Path
from unittest.mock import Mock

import pytest

from modt import host
from modt.errors import MisuseError


@pytest.mark.parametrize(
    ("text", "cores"), [("", set()), ("\n", set()), ("3\n", {3}), ("0-2,5\n", {0, 1, 2, 5}), ("1,3-4", {1, 3, 4})]
)
def test_lists_of_cores_of_the_kernel(text, cores):
    assert host.core_list(text) == cores


@pytest.mark.parametrize("module", ["modt.cli.main", "modt_commands.profile"])
def test_commands_load_what_sizes_thread_pools_only_once_they_are_pinned(module):
    code = f"import {module}, sys; print({{'numpy', 'scipy', 'onnxruntime'}} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


def test_threads_begun_elsewhere_stay_there_and_the_loop_where_it_is():
    allowed = os.sched_getaffinity(0)
    if len(allowed) < 2:
        pytest.skip("one core only")
    loop = max(allowed)
    others = host.other_cores(loop)
    assert others == allowed - {loop}
    assert host.other_cores(None) is None
    seen = []
    try:
        os.sched_setaffinity(0, {loop})
        assert host.other_cores(loop) is None
        with host.threads_on(others):
            thread = threading.Thread(target=lambda: seen.append(os.sched_getaffinity(0)))
            thread.start()
            thread.join()
        assert os.sched_getaffinity(0) == {loop}
    finally:
        os.sched_setaffinity(0, allowed)
    assert seen == [others]


def test_what_is_not_permitted_has_a_remedy(monkeypatch):
    monkeypatch.setattr(host.os, "sched_getscheduler", lambda _: os.SCHED_OTHER)
    monkeypatch.setattr(host.os, "sched_setscheduler", Mock(side_effect=PermissionError(1, "Not permitted")))
    monkeypatch.setattr(host.sys, "setswitchinterval", lambda _: None)
    monkeypatch.setattr(host, "_lock_memory", lambda: "the limit of locked memory is finite")
    refusals = host.take_real_time_priority()
    assert len(refusals) == 2
    assert all("; " in refusal for refusal in refusals)
    monkeypatch.setattr(host.os, "sched_getscheduler", lambda _: os.SCHED_FIFO)  # the loop has it, a receiver has not
    monkeypatch.setattr(host.os, "sched_getparam", lambda _: os.sched_param(10))
    assert "LimitRTPRIO=9" in host.serve_loop(None)


@pytest.mark.parametrize(("loop", "asked"), [(10, [9]), (1, [1]), (None, [])])
def test_a_thread_that_serves_the_loop_is_real_time_below_it(monkeypatch, loop, asked):
    given = []
    policy = os.SCHED_OTHER if loop is None else os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
    monkeypatch.setattr(host.os, "sched_getscheduler", lambda _: policy)
    monkeypatch.setattr(host.os, "sched_getparam", lambda _: os.sched_param(loop))
    monkeypatch.setattr(host.os, "sched_setscheduler", lambda _, __, p: given.append(p.sched_priority))
    assert host.serve_loop(None) == ""
    assert given == asked


def machine(folder, *, runtime="950000", cgroup="", share=None, capabilities="0"):
    """A /proc and a /sys/fs/cgroup."""
    files = {"proc/sys/kernel/sched_rt_runtime_us": runtime, "proc/self/cgroup": cgroup}
    files["proc/self/status"] = f"Name:\tmodt\nCapEff:\t{capabilities}\n"
    if share is not None:
        files["cgroup/cpu,cpuacct/robot/cpu.rt_runtime_us"] = share
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text + "\n")
    return folder / "proc", folder / "cgroup"


V1 = "4:cpu,cpuacct:/robot\n1:name=systemd:/"
V2 = "0::/system.slice/modt.service"


@pytest.mark.parametrize(
    ("facts", "cause", "remedy"),
    [
        ({"runtime": "0"}, "switched off", "sysctl -w kernel.sched_rt_runtime_us=950000"),
        ({"cgroup": V1, "share": "0", "capabilities": "800000"}, "cpu.rt_runtime_us 0", "groups above it"),
        ({"cgroup": V1, "share": "950000"}, "", "LimitRTPRIO=10"),
        ({"cgroup": V2}, "", "ulimit -r 10"),
        ({"cgroup": V2, "capabilities": "800000"}, "CONFIG_RT_GROUP_SCHED", "rt_group_sched=0"),
        ({"cgroup": V2, "capabilities": "7fffff"}, "", "LimitRTPRIO=10"),
    ],
)
def test_a_refused_priority_has_the_remedy_that_works(monkeypatch, tmp_path, facts, cause, remedy):
    monkeypatch.setattr(host.resource, "getrlimit", lambda _: (0, 0))
    found, helps = host.fifo_refusal(10, *machine(tmp_path, **facts))
    assert cause in found if cause else found == ""
    assert remedy in helps
    if cause:
        assert "ulimit" not in helps


def test_the_unit_starts_where_the_kernel_refuses_real_time():
    unit = (Path(__file__).parents[1] / "systemd" / "modt.service").read_text()
    assert "\nCPUSchedulingPolicy" not in unit
    assert "\nLimitRTPRIO=10" in unit


def test_an_isolated_core_is_used_though_it_is_not_inherited(monkeypatch):
    given = []
    monkeypatch.setattr(host.os, "sched_getaffinity", lambda _: {0, 1, 2})  # as with isolcpus=3
    monkeypatch.setattr(host.os, "sched_setaffinity", lambda _, cores: given.append(cores))
    monkeypatch.setattr(host.os, "environ", {})
    assert host.pin_to_core(3) == 3
    assert given == [{3}]


def test_a_core_that_the_kernel_refuses_is_a_misuse(monkeypatch):
    monkeypatch.setattr(host.os, "sched_getaffinity", lambda _: {0, 1, 2})
    monkeypatch.setattr(host.os, "sched_setaffinity", Mock(side_effect=OSError(22, "Invalid argument")))
    monkeypatch.setattr(host.os, "environ", {})
    with pytest.raises(MisuseError, match="core 3: not available to this process; use one of 0, 1, 2"):
        host.pin_to_core(3)
