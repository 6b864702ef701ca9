"""How to add a meter (docs/extending.md): its facts, its reading, and a search for it."""

from pathlib import Path

import pytest

from modt.config import EnergyConfig
from modt.energy.meters import discovery
from modt.energy.meters.meter import Candidate, Conditions, Facts, Kind, Scope, file_meter, probe
from modt.energy.windows import Clocks, Windows
from modt_profiling.energy.named_meter import choose_meter

FACTS = Facts(
    name="coulomb counter",
    unit="mJ",
    resolution=1e-3,
    max_W=100.0,
    scope=Scope.CPU,
    kind=Kind.MEASURED,
)


def find_coulomb_counters(sys: Path) -> list[Candidate]:
    path = sys / "coulomb" / "energy_mJ"
    if not path.exists():
        return [Candidate("coulomb counter", (), f"no {path}", "connect it")]
    return [probe("coulomb counter", (file_meter(FACTS, path, scale=1e-3),), f"make {path} readable")]


def test_the_meter_is_found_and_windows_have_its_energy(tmp_path, monkeypatch):
    counter = tmp_path / "coulomb" / "energy_mJ"
    counter.parent.mkdir()
    counter.write_text("1000")
    monkeypatch.setattr(discovery, "FINDERS", (lambda _sys: find_coulomb_counters(tmp_path),))
    found = discovery.discover(EnergyConfig())
    assert found.best.name == "coulomb counter"
    now_ns = 0
    clocks = Clocks(lambda: now_ns, lambda: now_ns, lambda: now_ns)
    windows = Windows(choose_meter(found, "coulomb").meters, clocks, Conditions())
    for reading_mJ in (1004, 1008):
        now_ns += 50_000_000
        counter.write_text(str(reading_mJ))
        window = windows.close()
    assert window.kind == "measured"
    assert window.energy_J == pytest.approx(0.004, abs=1e-9)
