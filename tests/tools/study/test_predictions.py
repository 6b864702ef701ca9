"""The table of blind predictions."""

from modt import profile
from tools.study import predictions
from tools.study.predictions import REGIMES, RIVALS, Study, outcomes, summary, table


def tree(measured, predicted, low, high, rival=9.0):
    """What a comparison against a prediction says of one mode."""
    names = {"predicted": {"value": predicted, "low": low, "high": high}}
    names |= {name: {"value": rival} for name in RIVALS}
    against = [{"name": f"gamma, efficient: {name}", "predicted": value} for name, value in names.items()]
    gamma = {"gamma_measured_cpu": {"value": measured}, "gamma_reconciled": {"value": 1.01 * measured}}
    return {"against": against, "savings": {"efficient": gamma}}


def test_the_table_says_how_far_a_prediction_and_its_rivals_are_off():
    near, far = tree(2.0, 2.1, 1.9, 2.3), tree(4.0, 5.0, 4.5, 5.5)
    found = [*outcomes("default", "a", near), *outcomes("paper", "b", far)]
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
        asked.append((arguments[0], "--against" in arguments))
        if arguments[0] == "simulate":
            (arguments[-1] / "day" / "drive_sync").mkdir(parents=True)
        if "--against" not in arguments:
            return "{}"
        rows = tree(2.0, 2.1, 1.9, 2.3)
        return predictions.json.dumps(rows)

    monkeypatch.setattr(predictions, "_command", command)
    monkeypatch.setattr("sys.argv", ["predictions", str(tmp_path), "--regimes", "default"])
    predictions.main()
    assert [what for what in asked if what[0] != "simulate"] == [
        *[("compare", False)] * 2,
        *[("predict", False)] * 2,
        *[("compare", True)] * 2,
    ]
    assert "2 tests" in capsys.readouterr().out
    predictions.main()  # of what is there
    assert len([what for what in asked if what[0] != "simulate"]) == 6


def test_every_regime_has_a_profile_that_loads(tmp_path, monkeypatch):
    monkeypatch.setattr(Study, "_drive", lambda self, stream: tmp_path)
    study = Study(tmp_path, None, 1, "none")
    for name, regime in REGIMES.items():
        study._stream(name, regime, regime.calibrations[0])
    for written in (tmp_path / "profiles").iterdir():
        profile.load(written)
