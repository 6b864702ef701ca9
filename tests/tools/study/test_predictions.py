"""The table of blind predictions."""

import json

from modt import profile
from tools.study import predictions
from tools.study.predictions import REGIMES, RIVALS, Study, outcomes, summary, table


def trees(measured, predicted, low, high, rival=9.0):
    """A prediction of one mode, and what a comparison says of it."""
    row = {"predicted": {"value": predicted, "low": low, "high": high}} | {name: {"value": rival} for name in RIVALS}
    gamma = {"gamma_measured_cpu": {"value": measured}, "gamma_reconciled": {"value": 1.01 * measured}}
    return {"gamma": {"efficient": row}}, {"savings": {"efficient": gamma}}


def test_the_table_says_how_far_a_prediction_and_its_rivals_are_off():
    near, far = trees(2.0, 2.1, 1.9, 2.3), trees(4.0, 5.0, 4.5, 5.5)
    found = [*outcomes("default", "a", *near), *outcomes("paper", "b", *far)]
    *_, first, second = table(found)
    assert "| 2.10 | 1.90 to 2.30 | 2.00 | +5.0 % |" in first
    assert "+25.0 % (outside)" in second
    said = "\n".join(summary(found))
    assert "2 tests, 2 ratios, gamma 2.00 to 4.00" in said
    assert "within 10 %: 50 %" in said
    assert "predicted 15.0 %" in said
    assert "reconciliation: median error 1.0 %, within 5 %: 100 %" in said


def test_predictions_are_written_before_any_mode_runs_on_their_streams(tmp_path, monkeypatch, capsys):
    asked = []

    def command(module, *arguments):
        asked.append((arguments[0], arguments.count("--calibration")))
        if arguments[0] == "simulate":
            (arguments[-1] / "day" / "drive_sync").mkdir(parents=True)
        prediction, found = trees(2.0, 2.1, 1.9, 2.3)
        return json.dumps(prediction | found)

    monkeypatch.setattr(predictions, "_command", command)
    monkeypatch.setattr("sys.argv", ["predictions", str(tmp_path), "--regimes", "default", "VLP-16"])
    predictions.main()
    made = [what for what in asked if what[0] != "simulate"]
    assert made == [("compare", 0)] * 4 + [("predict", 4)] * 8 + [("compare", 0)] * 8
    assert "8 tests" in capsys.readouterr().out
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
