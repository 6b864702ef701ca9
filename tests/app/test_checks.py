"""Checks before the first frame: each outcome has its line and, where something is wrong, a remedy."""

import numpy as np
import pytest

from modt.app import checks
from modt.config import ClassificationConfig, ProfileConfig, RecordingConfig, SensorConfig
from modt.energy.meters.discovery import Discovery
from modt.energy.meters.meter import Candidate, Facts, Kind, Meter, Scope
from modt.errors import MisuseError
from modt.sources.live.live_stream import LiveStream
from modt.sources.stream import Reception, StreamInfo, Sweep


def sysfs(root, **files):
    for path, text in files.items():
        file = root / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    return root


@pytest.mark.parametrize(
    ("isolated", "number", "level"), [("1-3\n", 2, "ok"), ("\n", 2, "warn"), ("1-3\n", None, "warn")]
)
def test_a_core_is_isolated_or_not(tmp_path, isolated, number, level):
    sys = sysfs(tmp_path, **{"devices/system/cpu/isolated": isolated})
    assert checks.core(number, sys).level == level


@pytest.mark.parametrize(("name", "level"), [("performance", "ok"), ("powersave", "warn"), (None, "ok")])
def test_a_governor_that_saves_power_is_warned_of(tmp_path, name, level):
    path = "devices/system/cpu/cpu3/cpufreq/scaling_governor"
    sys = sysfs(tmp_path, **({path: f"{name}\n"} if name else {}))
    assert checks.governor(3, sys).level == level


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


def candidate(kind, why_not="", remedy=""):
    facts = Facts(name=str(kind), unit="J", resolution=1.0, max_W=1.0, scope=Scope.CPU, kind=kind)
    return Candidate(str(kind), (Meter(facts, lambda: 0.0),), why_not, remedy)


def test_an_estimate_is_warned_of_with_the_remedy_of_the_meter_that_is_denied():
    assert checks.meters(Discovery((candidate(Kind.MEASURED), candidate(Kind.ESTIMATED)))).level == "ok"
    denied = candidate(Kind.MEASURED, "Permission denied", "grant CAP_DAC_READ_SEARCH")
    found = checks.meters(Discovery((candidate(Kind.ESTIMATED), denied)))
    assert (found.level, found.remedy) == ("warn", "grant CAP_DAC_READ_SEARCH")
    assert checks.meters(Discovery((candidate(Kind.ESTIMATED),))).level == "warn"


def test_a_model_that_differs_from_its_card_fails():
    def refuse():
        raise MisuseError("a.onnx", "hash differs", "install it again")

    config = ClassificationConfig()
    assert checks.model(config, lambda: {"sha256": "0123456789abcdef"}).level == "ok"
    assert checks.model(config, refuse) == checks.Finding("fail", "model", "a.onnx: hash differs", "install it again")


def test_a_disk_with_less_room_than_the_records_take_is_warned_of(tmp_path):
    out, config = tmp_path / "a" / "b", ProfileConfig(recording=RecordingConfig(disk_mb=100))
    assert checks.disk(out, config, lambda _: int(2e8)).level == "ok"
    assert checks.disk(out, config, lambda _: int(5e7)).level == "warn"
    none = ProfileConfig(recording=RecordingConfig(keep="none", disk_mb=100))
    assert checks.disk(out, none, lambda _: int(5e7)).level == "ok"
    assert not out.exists()


@pytest.mark.parametrize(("state", "now_s", "level"), [(0, None, "ok"), (5, None, "warn"), (0, 1000.0, "fail")])
def test_a_clock_is_set_and_synchronised_or_not(state, now_s, level):
    assert checks.clock(state, now_s).level == level


class Reader:
    def __init__(self, sweeps, messages=0, refused=None):
        self.reception = Reception(messages, 0, refused or {})
        self.sweeps = sweeps

    profile = None

    def read(self, timeout_s):
        sweeps, self.sweeps = self.sweeps, []
        return sweeps

    def close(self):
        pass


SWEEP = Sweep(1.0, np.full((10, 4), 0.5, np.float32))


@pytest.mark.parametrize(
    ("reader", "level", "said"),
    [
        (Reader([SWEEP], 1), "ok", "a sweep of 10 points"),
        (Reader([]), "fail", "nothing received"),
        (Reader([], 20, {"too short": 20}), "fail", "only unusable messages (too short)"),
        (Reader([], 20), "fail", "but no sweep"),
    ],
)
def test_a_sensor_is_heard_or_not(reader, level, said):
    info = StreamInfo("sensor", "test", 0, None, 0.1, None, False)
    (found,) = checks.sensor(lambda: LiveStream(info, reader), 0.3)
    assert found.level == level
    assert said in found.what
    assert found.remedy or level == "ok"


def test_a_sensor_that_cannot_be_opened_fails_with_the_remedy():
    def refuse():
        raise MisuseError("udp://x", "port taken", "give a free port")

    assert checks.sensor(refuse) == [checks.Finding("fail", "sensor", "udp://x: port taken", "give a free port")]


@pytest.mark.parametrize(
    ("sensor", "level", "said"),
    [
        ({"height_m": 0.3, "elevation_span_deg": (-15.0, 15.0)}, "warn", "from 1.1 m on"),
        ({"height_m": 0.5, "elevation_span_deg": (-7.0, 52.0)}, "ok", "from 0.5 m on"),
        ({"height_m": 0.5, "elevations_deg": (-25.0, 0.0, 25.0)}, "ok", "from 0.7 m on"),
        ({"height_m": 0.3}, "ok", "not known"),
        ({"height_m": None, "elevation_span_deg": (-15.0, 15.0)}, "ok", "not known"),
        ({"height_m": 5.0, "elevation_span_deg": (-5.0, 15.0)}, "ok", "not known"),
    ],
)
def test_how_much_is_seen_of_people_near_the_sensor_is_said(sensor, level, said):
    found = checks.near(SensorConfig(**sensor))
    assert found.level == level
    assert said in str(found)
