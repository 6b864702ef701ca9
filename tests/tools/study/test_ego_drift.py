"""Drift of ego-motion."""

import sys

import numpy as np
import pytest

from modt.geometry import rotation_zyx, se3
from modt.sources.recognise import open_stream
from modt_desk.simulation.synthetic_stream import SyntheticStream
from tests.desk.recorded import written
from tools.study import ego_drift


def circle(n, radius=20.0, scale=1.0, turn=1.0):
    angle = np.linspace(0, turn, n)
    position = scale * radius * np.c_[np.sin(angle), 1 - np.cos(angle), np.zeros(n)]
    return np.array([se3(rotation_zyx(0, 0, a), p) for a, p in zip(angle, position, strict=True)])


def test_drift_in_path_end_and_heading():
    reference = circle(200)
    moved = se3(rotation_zyx(0, 0, 2.0), np.array([5.0, 6.0, 0.0])) @ reference
    assert all(abs(v) < 1e-9 for v in ego_drift.drift(moved, reference).values())
    longer = ego_drift.drift(circle(200, scale=1.02), reference)
    assert longer["path_percent"] == pytest.approx(2.0)
    assert longer["end_percent"] == pytest.approx(2.0 * 2 * np.sin(0.5), rel=1e-4)  # chord over arc
    assert longer["heading_deg"] == pytest.approx(0.0, abs=1e-9)
    assert ego_drift.drift(circle(200, turn=1.01), reference)["heading_deg"] == pytest.approx(np.rad2deg(0.01))


@pytest.mark.slow
def test_the_drift_of_a_written_drive_is_small_against_positions_and_velocities(tmp_path, monkeypatch, capsys):
    drive = written(tmp_path, SyntheticStream("street", "vlp-16", 1.0, seed=2)).drive
    scans = open_stream(drive).scans
    positions = np.array([s.T_world_sensor for s in scans])
    integrated = ego_drift.integrated(drive, [s.index for s in scans])
    assert abs(ego_drift.drift(integrated, positions)["end_percent"]) < 0.5
    monkeypatch.setattr(sys, "argv", ["ego_drift", str(drive), str(drive)])
    ego_drift.main()
    said = capsys.readouterr().out
    assert "means over 2 drives" in said
    assert "proposals, camera against OXTS positions" in said
    figures = ego_drift.drift(ego_drift.by_proposals(open_stream(drive), camera=False), positions)
    assert abs(figures["heading_deg"]) < 1.0
    assert abs(figures["end_percent"]) < 5.0
