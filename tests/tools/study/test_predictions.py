"""The table of blind predictions."""

import json

from modt import profile
from tools.study import predictions
from tools.study.predictions import REGIMES, Study

ROW = {"predicted": {"value": 2.1, "low": 1.9, "high": 2.3}, predictions.COPIED: {"value": 9.0}}
ANSWER = {
    "gamma": {"efficient": ROW},
    "savings": {"efficient": {"gamma_measured_cpu": {"value": 2.0}}},
}


def test_predictions_are_written_before_any_mode_runs_on_their_streams(tmp_path, monkeypatch, capsys):
    asked = []

    def command(module, *arguments):
        asked.append((arguments[0], arguments.count("--calibration")))
        if arguments[0] == "simulate":
            (arguments[-1] / "day" / "drive_sync").mkdir(parents=True)
        return json.dumps(ANSWER)

    monkeypatch.setattr(predictions, "_command", command)
    monkeypatch.setattr("sys.argv", ["predictions", str(tmp_path), "--regimes", "default", "VLP-16"])
    predictions.main()
    made = [what for what in asked if what[0] != "simulate"]
    assert made == [("compare", 0)] * 4 + [("predict", 4)] * 8 + [("compare", 0)] * 8
    printed = capsys.readouterr().out
    assert "8 tests" in printed
    assert "| 2.10 | 1.90 to 2.30 | 2.00 | +5.0 % | +350.0 % |" in printed
    asked.clear()
    predictions.main()  # of what is there
    assert not asked


def test_every_regime_has_a_profile_that_loads(tmp_path, monkeypatch):
    monkeypatch.setattr(Study, "_drive", lambda self, stream: tmp_path)
    study = Study(tmp_path, None, 1, "none")
    for name, regime in REGIMES.items():
        study._stream(name, regime, regime.calibrations[0])
    for written in (tmp_path / "profiles").iterdir():
        profile.load(written)
