import itertools
import re

import pytest

from modt.config import EnergyConfig
from modt.energy.meters import meter as meter_module
from modt.energy.meters.discovery import discover, find_batteries, find_hwmon, find_pmic, find_powercap
from modt.energy.meters.meter import Kind, MeterLostError, Scope, model_meter
from modt.errors import MisuseError
from modt_profiling.energy.named_meter import choose_meter

from .meter_files import write_files, write_zone

PMIC = """ 3V7_WL_SW_A current(0)=0.08784000A
   VDD_CORE_A current(7)=2.10000000A
  3V7_WL_SW_V volt(8)=3.70000000V
   VDD_CORE_V volt(15)=0.80000000V
      EXT5V_V volt(24)=5.10000000V
       BATT_V volt(25)=0.00000000V
"""


def powercap(sys):
    return sys / "class" / "powercap"


def look(sys):
    return discover(EnergyConfig(idle_W=3.0, busy_W=7.0), sys, vcgencmd="no-such-command")


def server(sys):
    """Two sockets with subzones, a memory-mapped twin and the platform counter."""
    write_zone(powercap(sys) / "intel-rapl:0", "package-0", energy_uJ=5_000_000)
    write_zone(powercap(sys) / "intel-rapl:0:0", "core", energy_uJ=3_000_000)
    write_zone(powercap(sys) / "intel-rapl:0:1", "dram", energy_uJ=1_000_000)
    write_zone(powercap(sys) / "intel-rapl:1", "package-1", energy_uJ=7_000_000)
    write_zone(powercap(sys) / "intel-rapl:2", "psys", energy_uJ=20_000_000)
    write_zone(powercap(sys) / "intel-rapl-mmio:0", "package-0", energy_uJ=5_000_001)


def test_packages_are_summed_without_overlapping_zones(tmp_path):
    server(tmp_path)
    best = look(tmp_path).best
    names = [f"powercap intel-rapl:{n} (package-{n})" for n in (0, 1)]
    assert [meter.facts.name for meter in best.meters] == names
    assert sum(meter.read() for meter in best.meters) == pytest.approx(12.0)
    assert (best.meters[0].facts.kind, best.meters[0].facts.wrap_J) == (Kind.MEASURED, pytest.approx(262_143.328850))
    why = {c.name: c.why_not for c in find_powercap(tmp_path)}
    assert why["powercap intel-rapl:0:0 (core)"] == "counted by intel-rapl:0"
    assert why["powercap intel-rapl-mmio:0 (package-0)"] == "the same package again"
    (platform,) = choose_meter(look(tmp_path), "psys").meters
    assert (platform.facts.scope, platform.read()) == (Scope.BOARD, pytest.approx(20.0))


@pytest.mark.parametrize("mirrors", [True, False])
def test_counters_are_compared_while_they_count(tmp_path, monkeypatch, mirrors):
    """Each die of a Threadripper 1950X shows the socket; those of a Cascade Lake-AP have counters of their own.

    A mirror is read after the counter itself and shows more. Another counter may be near by chance.
    """
    for n in (0, 1):
        write_zone(powercap(tmp_path) / f"intel-rapl:{n}", f"package-0-die-{n}")
    true_uJ = itertools.count(10**9, 50_000)
    own = meter_module.read_number

    def read_number(path):
        if path.name != "energy_uj":
            return own(path)
        return float(next(true_uJ)) if mirrors or "rapl:0" in str(path) else 1_000_075_000.0

    monkeypatch.setattr(meter_module, "read_number", read_number)
    found = look(tmp_path)
    assert len(found.best.meters) == 1 + (not mirrors)
    left = [c.why_not for c in found.candidates if "die-1" in c.name]
    assert left == ["shows the counter of powercap intel-rapl:0 (package-0-die-0)"] * mirrors


@pytest.mark.parametrize("content", [None, "", "garbage"])
def test_a_memory_mapped_zone_alone_is_the_package_and_without_a_range_its_wrap_is_unknown(tmp_path, content):
    zone = powercap(tmp_path) / "intel-rapl-mmio:0"
    write_zone(zone, "package-0", wrap_uJ=None, energy_uJ=5_000_000)
    if content is not None:
        (zone / "max_energy_range_uj").write_text(content)
    best = look(tmp_path).best
    assert (best.name, best.meters[0].facts.wrap_J) == ("RAPL packages", None)
    assert best.meters[0].read() == pytest.approx(5.0)


def test_a_counter_that_cannot_be_read_is_listed_with_its_remedy(tmp_path):
    counter = powercap(tmp_path) / "intel-rapl:0" / "energy_uj"
    write_zone(counter.parent, "package-0")
    counter.unlink()
    counter.mkdir()
    found = look(tmp_path)
    assert found.best.facts.kind is Kind.ESTIMATED
    with pytest.raises(MisuseError, match=r"RAPL packages: .*energy_uj: Is a directory.*CAP_DAC_READ_SEARCH"):
        choose_meter(found, "rapl")


CHIP = {"name": "ina226", "in1_input": 5000, "curr1_input": 900}
BATTERY = {"type": "Battery", "status": "Discharging", "voltage_now": 11_400_000, "current_now": -1_500_000}


@pytest.mark.parametrize(
    ("folder", "files", "watts"),
    [
        ("powercap/arm-scmi:0", {"name": "soc", "power_uw": 4_250_000}, 4.25),
        ("power_supply/BAT0", BATTERY, 17.1),
        ("hwmon/hwmon0", CHIP, 4.5),
        ("hwmon/hwmon0", CHIP | {"power1_input": 4_600_000}, 4.6),  # the chip computes it
        ("hwmon/hwmon0", CHIP | {"name": "nct6775"}, None),
        ("power_supply/hid-1", {"type": "Battery", "scope": "Device", "status": "Discharging", "power_now": 9}, None),
        ("power_supply/AC", {"type": "Mains", "online": 1}, None),
    ],
)
def test_power_is_read_from_the_sensors_of_the_supply(tmp_path, folder, files, watts):
    write_files(tmp_path / "class" / folder, **files)
    best = look(tmp_path).best
    assert best.facts.kind is (Kind.ESTIMATED if watts is None else Kind.INTEGRATED)
    assert watts is None or best.meters[0].read() == pytest.approx(watts)


AGX_ORIN = {"VDD_GPU_SOC": (20000, 320), "VDD_CPU_CV": (20000, 260), "VIN_SYS_5V0": (5000, 900)}
AGX_XAVIER = dict.fromkeys(("GPU", "CPU", "SOC", "CV", "VDDRQ", "SYS5V"), (5000, 200))
NANO = {"POM_5V_IN": (5000, 600), "POM_5V_GPU": (5000, 0), "POM_5V_CPU": (5000, 200)}
NX = {"VDD_IN": (5000, 1000), "VDD_CPU_GPU_CV": (5000, 300), "VDD_SOC": (5000, 200)}


def board(sys, rails, model=""):
    """A Jetson with these rails (mV, mA), three on each chip."""
    for n, (label, (mV, mA)) in enumerate(rails.items()):
        k = n % 3 + 1
        channel = {f"in{k}_label": label, f"in{k}_input": mV, f"curr{k}_input": mA, f"in{k}_enable": 1}
        write_files(sys / "class" / "hwmon" / f"hwmon{n // 3}", name="ina3221", **channel)
    if model:
        write_files(sys / "firmware" / "devicetree" / "base", model=f"{model}\0")
    return look(sys)


def watts_of(found, name):
    return sum(meter.read() for meter in choose_meter(found, name).meters)


@pytest.mark.parametrize(
    ("rails", "model", "module", "watts", "best"),
    [
        (AGX_ORIN, "NVIDIA Jetson AGX Orin Developer Kit", "AGX Orin module", 16.1, "VDD_CPU_CV"),
        (AGX_XAVIER, "Jetson-AGX", "AGX Xavier module", 6.0, "ina3221 CPU"),
        (AGX_XAVIER, "NVIDIA Jetson AGX Xavier Developer Kit", "AGX Xavier module", 6.0, "ina3221 CPU"),
        (NANO, "NVIDIA Jetson Nano Developer Kit", "POM_5V_IN", 3.0, "POM_5V_CPU"),
        (NX, "NVIDIA Jetson Xavier NX Developer Kit", "VDD_IN", 5.0, "VDD_CPU_GPU_CV"),
        (NX, "NVIDIA Orin Nano Developer Kit", "VDD_IN", 5.0, "VDD_CPU_GPU_CV"),
        (NX, "NVIDIA Jetson Orin NX Engineering Reference Developer Kit", "VDD_IN", 5.0, "VDD_CPU_GPU_CV"),
    ],
)
@pytest.mark.parametrize("named", [True, False])
def test_the_rails_of_a_module_follow_the_table_of_its_board(tmp_path, rails, model, module, watts, best, named):
    found = board(tmp_path, rails, model if named else "")
    chosen = choose_meter(found, module)
    assert watts_of(found, module) == pytest.approx(watts)
    assert {meter.facts.scope for meter in chosen.meters} == {Scope.MODULE}
    assert best in found.best.name
    assert found.best.meters[0].facts.scope is Scope.CPU_RAIL


def test_rails_beside_a_module_are_listed_and_never_added(tmp_path):
    """VIN_SYS_5V0 feeds the memory's rail, NC is not connected, and VDD_GPU_SOC is switched off."""
    found = board(tmp_path, AGX_ORIN | {"NC": (0, 0), "VDDQ_VDD2_1V8AO": (5000, 200)})
    assert choose_meter(found, "hwmon ina3221 VIN_SYS_5V0").meters[0].facts.scope is Scope.RAIL
    assert watts_of(found, "hwmon ina3221 VIN_SYS_5V0") == pytest.approx(4.5)
    write_files(tmp_path / "class" / "hwmon" / "hwmon0", in1_enable=0)
    write_files(tmp_path / "class" / "hwmon" / "hwmon1", in4_label="sum", in4_input=2, curr4_input=1900)
    names = [c.name for c in look(tmp_path).candidates if c.usable]
    assert not [name for name in names if re.search("NC|VDD_GPU_SOC|sum", name)]


@pytest.mark.parametrize(("rails", "model"), [(NX, "Some Carrier"), ({"VDD_IN": (5000, 1000)}, "")])
def test_rails_of_an_unknown_board_are_of_unknown_extent(tmp_path, rails, model):
    found = board(tmp_path, rails, model)
    assert {m.facts.scope for c in found.candidates for m in c.meters} == {Scope.RAIL, Scope.PROCESS}


def test_a_module_is_usable_without_one_of_its_rails_but_not_if_it_draws_less_than_they_do(tmp_path):
    board(tmp_path, NX)
    (tmp_path / "class" / "hwmon" / "hwmon0" / "curr3_input").write_text("none")
    assert watts_of(look(tmp_path), "VDD_IN") == pytest.approx(5.0)
    found = board(tmp_path, NX | {"VDD_IN": (5000, 400)})
    with pytest.raises(MisuseError, match="less than the rails that it feeds"):
        choose_meter(found, "VDD_IN")


def test_two_chips_with_one_label_are_two_rails(tmp_path):
    for n in (0, 1):
        folder = tmp_path / "class" / "hwmon" / f"hwmon{n}"
        write_files(folder, name="ina226", in1_label="motor", in1_input=5000, curr1_input=100 * (n + 1))
    readings = sorted(m.read() for c in find_hwmon(tmp_path) for m in c.meters)
    assert readings == [pytest.approx(0.5), pytest.approx(1.0)]


def test_battery_counts_only_while_it_discharges(tmp_path):
    write_files(tmp_path / "class" / "power_supply" / "BAT0", **BATTERY | {"status": "Charging"})
    (battery,) = find_batteries(tmp_path)
    assert (battery.usable, battery.remedy) == (False, "unplug the charger")
    with pytest.raises(MeterLostError, match="charging"):
        battery.meters[0].read()


def script(folder, body):
    path = folder / "vcgencmd"
    path.write_text(f"#!/bin/sh\n{body}\n")
    path.chmod(0o755)
    return str(path)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("2.10000000A", "1.2.3A", "VDD_CORE is '1.2.3'"),
        ("2.10000000A", "A", "VDD_CORE is ''"),
        ("0.80000000V", "nanoV", "VDD_CORE is 'nano'"),
        ("VDD_CORE_V", "VDD_C", "lacks VDD_CORE"),
        ("VDD_CORE_A", "\\377\\376", "lacks VDD_CORE"),
        (PMIC, "", "no rail"),
        (PMIC, "error=2 error_msg=Invalid arguments", "Raspberry Pi 5"),
    ],
)
def test_pmic_is_read_through_its_command_and_lost_for_now_where_it_is_garbled(tmp_path, old, new, message):
    (tmp_path / "adc").write_text(PMIC)
    (failing,) = find_pmic(script(tmp_path, "echo 'VCHI initialization failed' >&2; exit 255"))
    assert "VCHI initialization failed" in failing.why_not
    (pmic,) = find_pmic(script(tmp_path, f'[ $1 = pmic_read_adc ] && printf "$(cat {tmp_path}/adc)\\n"'))
    assert pmic.usable
    assert pmic.meters[0].read() == pytest.approx(0.08784 * 3.7 + 2.1 * 0.8)
    (tmp_path / "adc").write_text(PMIC.replace(old, new))
    with pytest.raises(MeterLostError, match=re.escape(message)):
        pmic.meters[0].read()


@pytest.mark.parametrize("content", ["9" * 400, "9" * 5000, "0x10", "1.5", "", "nan"])
def test_a_file_without_an_integer_is_lost_for_now(tmp_path, content):
    zone = powercap(tmp_path) / "intel-rapl:0"
    write_zone(zone, "package-0")
    meter = look(tmp_path).best.meters[0]
    (zone / "energy_uj").write_text(content)
    with pytest.raises(MeterLostError):
        meter.read()


def test_without_meters_the_model_is_used(tmp_path):
    found = look(tmp_path)
    model = model_meter(EnergyConfig(idle_W=3.0, busy_W=7.0), lambda: 2 * 10**9, lambda: 10**9 // 2)
    assert model.read() == pytest.approx(3.0 * 2.0 + 4.0 * 0.5)
    assert found.best.facts.kind is Kind.ESTIMATED
    unusable = [c for c in found.candidates if not c.usable]
    assert len(unusable) == 4
    assert all(c.why_not and c.remedy for c in unusable)
    with pytest.raises(MisuseError, match="model 3 W idle"):
        choose_meter(found, "wattmeter")


def test_candidates_are_ordered_measured_integrated_estimated(tmp_path):
    server(tmp_path)
    kinds = [c.facts.kind for c in board(tmp_path, NX).candidates if c.usable]
    assert list(dict.fromkeys(kinds)) == [Kind.MEASURED, Kind.INTEGRATED, Kind.ESTIMATED]


def test_two_batteries_are_one_source_and_a_full_one_gives_nothing(tmp_path):
    supplies = tmp_path / "class" / "power_supply"
    for name, status in (("BAT0", "Discharging"), ("BAT1", "Discharging")):
        write_files(supplies / name, **BATTERY | {"status": status})
    (battery,) = find_batteries(tmp_path)
    both_W = battery.meters[0].read()
    assert battery.name == "batteries BAT0 + BAT1"
    (supplies / "BAT1" / "status").write_text("Not charging")
    assert battery.meters[0].read() == pytest.approx(both_W / 2)
    (supplies / "BAT1" / "status").write_text("Charging")
    with pytest.raises(MeterLostError, match="BAT1 is charging"):
        battery.meters[0].read()
