import pytest

from modt.config import EnergyConfig
from modt_desk.energy.run_energy import EnergySums
from tests.energy.simulated import CALIBRATED, line_of, window_of


def test_watts_of_a_stage_are_its_energy_over_its_cpu_time() -> None:
    sums, calibrated = EnergySums(EnergyConfig()), EnergySums(CALIBRATED)
    for each in (sums, calibrated):
        each.add_window(window_of(line_of(5.0, 2, 4)))
        each.add_window(window_of(line_of(None, 2, 4)))
    assert (sums.gross_J, sums.dropped) == (5.0, 1)
    assert sums.stage_watts(["segmentation", "fusion"]) == pytest.approx({"segmentation": 4.0, "fusion": 0.0})
    assert sums.watts("segmentation", "classification") == pytest.approx(4.0)
    assert calibrated.watts("segmentation") == pytest.approx(0.2 / 0.3)


def test_the_model_gives_every_stage_the_same_watts_and_a_calibration_leaves_stages_without_a_part() -> None:
    sums = EnergySums(EnergyConfig(idle_W=3.0, busy_W=8.0))
    sums.add_frame(line_of(None, 1, frame=0, cpu_ns=500_000_000))
    assert sums.gross_J == pytest.approx(3.0 + 2.5)
    assert sums.stage_watts(["segmentation", "classification"]) == pytest.approx(
        {"segmentation": 5.0, "classification": 5.0}
    )
    calibrated = EnergySums(CALIBRATED)
    line = window_of(line_of(5.0, 1))
    line["stages"]["tracking"] = line["stages"]["segmentation"]
    calibrated.add_window(line)
    assert calibrated.stage_watts(["tracking"]) == {}
