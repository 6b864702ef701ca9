"""The table of blind predictions."""

import json

from tools.study import predictions
from tools.study.predictions import RIVALS


def trees(measured, predicted, low, high, rival=9.0):
    """A prediction of one mode, and what a comparison says of it."""
    row = {"predicted": {"value": predicted, "low": low, "high": high}} | {name: {"value": rival} for name in RIVALS}
    gamma = {"gamma_measured_cpu": {"value": measured}, "gamma_reconciled": {"value": 1.01 * measured}}
    return {"gamma": {"efficient": row}}, {"savings": {"efficient": gamma}}


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
