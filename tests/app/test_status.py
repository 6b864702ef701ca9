"""Figures of the status, as JSON, as a line, and as metrics."""

from dataclasses import replace

import pytest

from modt.app.prometheus import metrics_text, write_metrics
from modt.app.status import FrameCounter, PowerStatus
from modt.config import EnergyConfig
from modt.energy.ledger import StageWork
from modt.energy.meters.meter import Kind
from modt.errors import ModtError
from modt.reporting.summary import Summary
from tests.results import TWO, energy_window, result, status


def test_metrics_are_valid_lines_with_one_type_each():
    lines = metrics_text(status(frame_J=None)).splitlines()
    assert len([line for line in lines if line.startswith("# TYPE modt_loop_lateness_ms ")]) == 1
    assert 'modt_loop_lateness_ms{quantile="p99"} 0.9' in lines
    assert {'modt_counts_visible{class="car"} 2', "modt_loop_step 2"} <= {*lines}
    assert 'modt_counts_left_out{kind="ground"} 900.5' in lines
    assert 'modt_power_stages_J{stage="segmentation"} 0.25' in lines
    assert 'modt_sink_written_total{sink="udp://x"} 5' in lines
    assert 'modt_sensor_refused_messages_total{reason="too short"} 3' in lines
    assert 'modt_loop_failures_total{kind="frame: \\"x\\""} 2' in lines
    assert {"modt_trust_level 2", 'modt_trust_reason{check="returns"} 2'} <= {*lines}
    assert 'modt_trust_frames_total{level="blind"} 5' in lines
    assert "modt_trust_visibility_metres 42" in lines
    assert "# TYPE modt_sensor_lost_messages_total counter" in lines
    assert not [line for line in lines if "None" in line or "frame_J" in line]


def test_the_file_of_metrics_is_replaced_as_a_whole(tmp_path):
    write_metrics(tmp_path / "modt.prom", metrics_text(status()))
    write_metrics(tmp_path / "modt.prom", metrics_text(status()))
    assert [p.name for p in tmp_path.iterdir()] == ["modt.prom"]
    with pytest.raises(ModtError, match="missing"):
        write_metrics(tmp_path / "missing" / "modt.prom", metrics_text(status()))


def test_counts_are_of_what_is_seen_and_the_rate_of_the_time_since_the_last_report():
    totals = Summary()
    counter = FrameCounter(totals, 10.0)
    assert counter.report(10.0).tracks == 0
    for k in range(20):
        totals.add_result(result(k, *TWO, lost=(3,), classified=1))
    counts = counter.report(12.0)
    assert (counts.frames, counts.rate_hz, counts.tracks) == (20, 10.0, 3)
    assert counts.visible["car"] == 1
    assert set(counts.left_out.values()) == {0}, "made-up proposals do not tell the kinds of the points"
    assert counts.classifications == 20
    assert counter.report(13.0).rate_hz == 0.0


def test_power_is_that_of_the_last_window_and_unknown_without_a_meter():
    stages = {"segmentation": StageWork(cpu_ns=300), "tracking": StageWork(cpu_ns=100)}
    window = energy_window(12.0, 20, wall_ns=2_000_000_000, process_ns=400, stages=stages)
    power = PowerStatus().after(window, EnergyConfig(idle_W=2.0))
    assert (power.watts, power.frame_J) == pytest.approx((6.0, 0.6))
    assert power.stages_J == pytest.approx({"idle": 0.2, "segmentation": 0.3, "tracking": 0.1, "unattributed": 0.0})
    unread = power.after(replace(window, energy_J=None, kind=Kind.UNAVAILABLE), EnergyConfig(idle_W=2.0))
    assert (unread.watts, unread.stages_J, unread.windows, unread.unread_windows) == (None, {}, 2, 1)
