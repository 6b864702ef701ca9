"""Checks before the first frame: each outcome has its line and, where something is wrong, a remedy."""

import numpy as np
import pytest

from modt.app import checks
from modt.config import ClassificationConfig, ProfileConfig, RecordingConfig, SensorConfig
from modt.energy.meters.discovery import Discovery
from modt.energy.meters.meter import Candidate, Facts, Kind, Meter, Scope
from modt.errors import MisuseError
from modt.sources.live.live_stream import LiveStream
from modt.sources.stream import StreamInfo, Sweep
from tests.energy.meter_files import write_files
from tests.sources.live.readers import scripted


def core(sys, isolated, number):
    write_files(sys / "devices/system/cpu", isolated=isolated)
    return checks.core(number, sys)


def governor(sys, name):
    write_files(sys / "devices/system/cpu/cpu3/cpufreq", scaling_governor=name)
    return checks.governor(3, sys)


def candidate(kind, why_not="", remedy=""):
    facts = Facts(name=str(kind), unit="J", resolution=1.0, max_W=1.0, scope=Scope.CPU, kind=kind)
    return Candidate(str(kind), (Meter(facts, lambda: 0.0),), why_not, remedy)


def refuse():
    raise MisuseError("a.onnx", "hash differs", "install it again")


def disk(folder, free_bytes, **recording):
    config = ProfileConfig(recording=RecordingConfig(disk_mb=100, **recording))
    found = checks.disk(folder / "a" / "b", config, lambda _: int(free_bytes))
    assert not (folder / "a").exists()
    return found


def near(height_m, **sensor):
    return checks.near(SensorConfig(height_m=height_m, **sensor))


def sensor(sweeps, messages, **refused):
    reader = scripted(sweeps, messages=messages, refused=refused)
    (found,) = checks.sensor(lambda: LiveStream(StreamInfo("sensor", "test"), reader), 0.3)
    return found


MEASURED = candidate(Kind.MEASURED)
ESTIMATED = candidate(Kind.ESTIMATED)
DENIED = candidate(Kind.MEASURED, "Permission denied", "grant CAP_DAC_READ_SEARCH")
SWEEP = Sweep(1.0, np.full((10, 4), 0.5, np.float32))


@pytest.mark.parametrize(
    ("check", "level", "words"),
    [
        (lambda sys: core(sys, "1-3\n", 2), "ok", ""),
        (lambda sys: core(sys, "\n", 2), "warn", "isolcpus=2 to the kernel's command line, and give --core 2"),
        (lambda sys: core(sys, "3\n", 2), "warn", "give --core 3, isolated by the kernel"),
        (lambda sys: core(sys, "1-3\n", None), "warn", ""),
        (lambda sys: governor(sys, "performance"), "ok", ""),
        (lambda sys: governor(sys, "powersave"), "warn", "powersave"),
        (lambda sys: checks.governor(3, sys), "ok", ""),
        (lambda _: checks.meters(Discovery((MEASURED, ESTIMATED))), "ok", ""),
        (lambda _: checks.meters(Discovery((ESTIMATED, DENIED))), "warn", "grant CAP_DAC_READ_SEARCH"),
        (lambda _: checks.meters(Discovery((ESTIMATED,))), "warn", ""),
        (lambda _: checks.model(ClassificationConfig(), lambda: {"sha256": "0123456789abcdef"}), "ok", ""),
        (lambda _: checks.model(ClassificationConfig(), refuse), "fail", "a.onnx: hash differs; install it again"),
        (lambda out: disk(out, 2e8), "ok", ""),
        (lambda out: disk(out, 5e7), "warn", ""),
        (lambda out: disk(out, 5e7, keep="none"), "ok", ""),
        (lambda _: checks.clock(0, None), "ok", ""),
        (lambda _: checks.clock(5, None), "warn", ""),
        (lambda _: checks.clock(0, 1000.0), "fail", ""),
        (lambda _: near(0.3, elevation_span_deg=(-15.0, 15.0)), "warn", "from 2.1 m on"),
        (lambda _: near(0.5, elevations_deg=(-25.0, 0.0, 25.0)), "ok", "from 1.0 m on"),
        (lambda _: near(0.3), "ok", "not known"),
        (lambda _: near(None, elevation_span_deg=(-15.0, 15.0)), "ok", "not known"),
        (lambda _: near(5.0, elevation_span_deg=(-5.0, 15.0)), "ok", "not known"),
        (lambda _: sensor([SWEEP], 1), "ok", "a sweep of 10 points"),
        (lambda _: sensor([], 0), "fail", "nothing received"),
        (lambda _: sensor([], 20, short=20), "fail", "only unusable messages (short)"),
        (lambda _: sensor([], 20), "fail", "but no sweep"),
        (lambda _: checks.sensor(refuse)[0], "fail", "a.onnx: hash differs; install it again"),
        (lambda _: checks.kernels(refuse), "fail", "install it again"),
    ],
)
def test_each_outcome_has_its_level_and_what_is_wrong_its_remedy(check, level, words, tmp_path):
    found = check(tmp_path)
    assert found.level == level
    assert words in str(found)
    assert found.remedy or level == "ok"


@pytest.mark.parametrize(
    ("loop", "receiver", "levels"),
    [([], "", ["ok"]), (["a is not permitted; set b", "c; set d"], "", ["warn"] * 2), ([], "e; set f", ["warn"])],
)
def test_each_missing_permission_has_its_line(monkeypatch, loop, receiver, levels):
    monkeypatch.setattr(checks.host, "take_real_time_priority", lambda: [*loop])
    monkeypatch.setattr(checks.host, "serve_loop", lambda cores: receiver)
    found = checks.permissions()
    assert [f.level for f in found] == levels
    assert all(f.remedy for f in found if f.level != "ok")
