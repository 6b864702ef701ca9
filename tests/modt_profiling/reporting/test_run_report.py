import json
import pickle
import re
from collections import Counter, defaultdict

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from modt import profile
from modt.classification.call_cost import padded_size
from modt.config import ClassificationConfig, ProfileConfig
from modt.energy.ledger import StageWork
from modt.errors import MisuseError
from modt.pipeline import STAGES
from modt_profiling.reporting.document import TERMS
from modt_profiling.reporting.energy_plots import stage_energy_mJ
from modt_profiling.reporting.quantity import to_json
from modt_profiling.reporting.run_report import run_document, run_plots, run_tree
from modt_profiling.reporting.run_sums import FrameSeries, FrameSums
from tests import results
from tests.results import CAR, frame_record, result


def run_text(tree):
    return run_document(tree).text()


KINDS = {"measured", "integrated", "estimated", "unavailable"}
MS = 1_000_000


def ledger_line(frame, classified):
    stages = {
        "source": row(1, 0, 2),
        "segmentation": row(1, 20, 10),
        "tracking": row(1, 20, 2),
        "fusion": row(2, 20, 1),
        "scheduling": row(1, 0, 1),
    }
    if classified:
        stages["classification"] = row(1, classified, 2 + classified, points=40 * classified)
    spans = sum(s["wall_ns"] for s in stages.values())
    return {
        "schema": "modt.ledger/1",
        "frame": frame,
        "stages": stages,
        "wall_ns": spans + 5 * MS,
        "cpu_ns": spans + MS,
        "overhead_ns": 20_000,
        "idle_ns": 5 * MS - 20_000,
        "marks": [],
    }


def row(calls, items, ms, points=0):
    return {"calls": calls, "items": items, "points": points, "wall_ns": ms * MS, "cpu_ns": ms * MS}


CAR_AND_BACKGROUND = result(0, [40, 40], {0: 0, 1: 1}, {0: CAR})
CAR_AND_BACKGROUND.tracks.key_points[0] = 40
CAR_AND_BACKGROUND.tracks.final[0] = True
CAR_AND_BACKGROUND.tracks.points[:] = 40
CAR_AND_BACKGROUND.tracks.age[:] = 1
NAMED, NAMELESS = frame_record(CAR_AND_BACKGROUND)["tracks"]


def track(id_, proposal, named):
    return {**(NAMED if named else NAMELESS), "id": id_, "proposal": proposal}


def window(index, lines, energy_J, kind="measured", marks=()):
    stages = defaultdict(Counter)
    for line in lines:
        for name, own in line["stages"].items():
            stages[name].update(own)
    return {
        "schema": "modt.energy/1",
        "window": index,
        "frames": [lines[0]["frame"], lines[-1]["frame"], len(lines)],
        "wall_ns": sum(line["wall_ns"] for line in lines),
        "process_ns": sum(line["cpu_ns"] for line in lines),
        "overhead_ns": 0,
        "idle_ns": 0,
        "stages": stages,
        "energy_J": energy_J,
        "kind": kind,
        "resolution_J": 1e-4,
        "meters": [{"name": "RAPL packages", "kind": kind, "scope": "CPU packages", "J": energy_J}],
        "conditions": {"governor": "performance", "frequency_MHz": 2600.0, "temperature_C": 50.0},
        "marks": list(marks),
    }


def write_run(path, *, windows=True, mode="efficient", frames=20, energy=None):
    path.mkdir()
    config = profile.dump(ProfileConfig())
    config["energy"] |= energy or {}
    facts = {"schema": "modt.run/1", "stream": {"name": "street"}, "mode": mode, "fov": "full", "core": 0}
    (path / "run.yaml").write_text(yaml.safe_dump({**facts, "profile": config}))
    lines = [ledger_line(k, (k * 7) % 5) for k in range(frames)]
    with (path / "ledger.jsonl").open("w") as out:
        for k, line in enumerate(lines):
            out.write(json.dumps(line) + "\n")
            if windows and k % 5 == 4:
                out.write(json.dumps(window(k // 5, lines[k - 4 : k + 1], 1.5)) + "\n")
    with (path / "tracks.jsonl").open("w") as out:
        for k in range(frames):
            tracks = [track(id_, id_, named=id_ < 15) for id_ in range(20)]
            record = {"frame": k, "proposals": 20, "classifications": (k * 7) % 5, "deferred": 0, "tracks": tracks}
            out.write(json.dumps({"schema": "modt.frame/4", **record}) + "\n")
    (path / "summary.json").write_text("{}")
    return path


def test_energy_is_that_of_the_meter(run):
    tree = run_tree(run)
    assert tree["gross_J"].value == pytest.approx(1.5 / 5)
    assert (tree["gross_J"].kind.value, tree["net_J"].kind.value) == ("measured", "estimated"), "of the idle power"
    assert tree["meter"] == {"name": "RAPL packages", "kind": "measured", "windows": 4}
    assert tree["conditions"]["governor"] == "performance"
    assert tree["ended"]


def test_without_windows_energy_is_modelled(tmp_path):
    tree = run_tree(write_run(tmp_path / "run", windows=False, energy={"idle_W": 2.0, "busy_W": 6.0}))
    assert tree["gross_J"].kind.value == "estimated"
    lines = [ledger_line(k, (k * 7) % 5) for k in range(20)]
    expected = sum(2e-9 * line["wall_ns"] + 4e-9 * line["cpu_ns"] for line in lines) / 20
    assert tree["gross_J"].value == pytest.approx(expected)
    assert "not the physics" in tree["test"]
    assert not [text for text in (run_text(tree), *(plot.note for plot in run_plots(tree))) if "measured" in text]


@pytest.mark.parametrize("calibration", [{}, {"seg_J": 0.1, "class_J": 0.01, "point_J": 1e-5}])
def test_plots_show_the_energy_that_the_report_attributes(tmp_path, calibration):
    tree = run_tree(write_run(tmp_path / "run", energy={"idle_W": 2.0, **calibration}))
    shown = {stage: mJ.mean() for stage, mJ in stage_energy_mJ(tree["series"]).items()}
    for stage in ("segmentation", "classification"):
        assert shown[stage] == pytest.approx(1e3 * tree["parts_J"][stage].value, rel=1e-3)
    assert ("tracking" in shown) is not bool(calibration)
    assert tree["saved"]["E_seg"].value == pytest.approx(tree["parts_J"]["segmentation"].value)
    assert sum(p.value for p in tree["parts_J"].values()) == pytest.approx(tree["gross_J"].value)
    pipeline_J = sum(tree["parts_J"][stage].value for stage in STAGES if stage in tree["parts_J"])
    assert tree["pipeline_J"].value == pytest.approx(pipeline_J)


def test_counts_and_terms(run, tmp_path):
    saved = run_tree(run)["saved"]
    assert saved["N_go"].value == pytest.approx(20.0)
    assert saved["beta"].value == pytest.approx(2 / 20)
    changes = sum(t["change"].value for t in saved["terms"])
    assert saved["gamma_short"].value + changes == pytest.approx(saved["gamma_of_this_run"].value)
    assert saved["gamma_reconciled"].value == pytest.approx(saved["gamma_of_this_run"].value, rel=0.01)
    conventional = run_tree(write_run(tmp_path / "conventional", mode="conventional"))
    assert conventional["saved"]["gamma_of_this_run"].value == pytest.approx(1.0)


def test_a_report_of_a_long_run_holds_no_more_than_one_of_a_short_run(tmp_path):
    """Tracks begin and end all the time. After 3,000 frames no more is held than after 1,500."""

    def held(frames):
        sums = FrameSums(padded_size(ClassificationConfig(max_points=400)))
        for k in range(frames):
            tracks = [track(id_, id_ - k, named=True) for id_ in range(k, k + 20)]
            record = {"proposals": 20, "classifications": 1, "deferred": 0, "tracks": tracks}
            sums.add(results.ledger_line(k, classification=StageWork(1, 1, 40)), record)
        assert sums.counts().tracks == sums.counts().classified_tracks == frames + 19
        assert sums.counts().proposals == 20 * frames
        return len(pickle.dumps(sums))

    assert held(3000) < 1.02 * held(1500)


def test_unfinished_run_is_reported_so_far(run):
    (run / "summary.json").unlink()
    with (run / "ledger.jsonl").open("a") as out:
        out.write('{"schema": "modt.led')
    tree = run_tree(run)
    assert not tree["ended"]
    assert tree["frames"] == 20
    assert "still running" in run_text(tree)


@pytest.mark.parametrize(
    ("energy_J", "more", "mark"),
    [(None, ("unavailable", ["lost"]), "lost")]
    + [(energy_J, (), "implausible") for energy_J in (-0.4, 7e4, float("nan"), float("inf"))],
)
def test_windows_that_cannot_be_are_dropped_and_reported(run, energy_J, more, mark):
    lines = [ledger_line(k, 1) for k in range(5)]
    with (run / "ledger.jsonl").open("a") as out:
        out.write(json.dumps(window(9, lines, energy_J, *more)) + "\n")
    tree = run_tree(run)
    assert (tree["dropped_windows"], tree["marks"]) == (1, [mark])
    assert tree["gross_J"].value == pytest.approx(0.3)
    assert f"marked: {mark}" in run_text(tree)


@pytest.mark.parametrize("order", [1, -1])
def test_a_run_is_as_reliable_as_its_least_reliable_window(run, order):
    kept = [window(k, [ledger_line(k, 1)], 0.3, kind) for k, kind in enumerate(["measured", "estimated"][::order])]
    ledger = (run / "ledger.jsonl").read_text().splitlines()
    frames = [line for line in ledger if "modt.ledger" in line]
    (run / "ledger.jsonl").write_text("\n".join([*frames, *map(json.dumps, kept)]) + "\n")
    tree = run_tree(run)
    assert tree["gross_J"].kind.value == "estimated"
    assert "assumed power" in tree["test"]


def figures(tree):
    """Every place in plain data that holds a number outside a series or an identity."""
    if isinstance(tree, dict):
        if "value" in tree:
            yield tree
            return
        for key, value in tree.items():
            if key not in ("series", "conditions", "meter"):
                yield from figures(value)
    elif isinstance(tree, list):
        for value in tree:
            yield from figures(value)
    elif isinstance(tree, float):
        yield {"bare": tree}


def test_every_figure_carries_its_kind(run):
    found = list(figures(to_json(run_tree(run))))
    assert len(found) > 40
    assert all(f.get("kind") in KINDS for f in found), [f for f in found if f.get("kind") not in KINDS]


def test_text_fits_a_terminal(run):
    text = run_text(run_tree(run))
    assert all(f"  {term}" in text for term in TERMS)
    assert max(map(len, text.splitlines())) <= 100


@pytest.mark.parametrize("missing", ["run.yaml", "ledger.jsonl", "tracks.jsonl", "no whole frame"])
def test_missing_records_are_named(run, missing):
    if "." in missing:
        (run / missing).unlink()
    else:
        (run / "ledger.jsonl").write_text("")
    with pytest.raises(MisuseError, match=re.escape(missing)):
        run_tree(run)


@given(st.lists(st.integers(0, 100), min_size=1, max_size=200))
def test_points_hold_the_sums_of_their_frames(values):
    series = FrameSeries(1, points=8)
    for value in values:
        series.add([value])
    frames = series.frames
    means = series.means[:, 0]
    assert len(frames) == len(means) <= 8
    ends = np.cumsum(frames)
    assert ends[-1] == series.count == len(values)
    assert set(frames[:-1].tolist()) <= {series.frames_a_point}
    expected = [np.mean(part) for part in np.split(np.array(values), ends[:-1])]
    np.testing.assert_allclose(means, expected)
    assert series.total[0] == pytest.approx(sum(values))
