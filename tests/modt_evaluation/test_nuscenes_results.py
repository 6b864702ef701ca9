"""Results in nuScenes' format, and their score against that of its devkit.

The devkit asks for NumPy 1, so it is not among the tests' libraries. It works beside NumPy 2 if installed by
`pip install --no-deps nuscenes-devkit cachetools descartes joblib motmetrics narwhals opencv-python-headless pandas
parameterized pyquaternion python-dateutil pytz scikit-learn six threadpoolctl`.
"""

import json

import numpy as np
import pytest

from modt.errors import MisuseError
from modt.sources import nuscenes
from modt_evaluation.nuscenes_results import scene_of, scores, submission
from tests.cli.commands import here
from tests.sources.datasets import Box, Sweep, turned, write_nuscenes

CATEGORIES = (
    *("vehicle.car", "human.pedestrian.adult", "human.pedestrian.child", "vehicle.bicycle", "vehicle.truck"),
    "static_object.bicycle_rack",
)
NAME = "scene-0103"
"""A scene of the split mini_val."""


def random_scene(root, seed):
    """A scene of objects that go about; some are labelled in some samples alone, some hold no point."""
    rng = np.random.default_rng(seed)
    kinds = rng.integers(0, len(CATEGORIES), 40)
    places = rng.uniform(-60, 60, (40, 2))
    speeds = rng.normal(0, 2, (40, 2))
    sweeps = []
    for k in range(6):
        boxes = []
        for i in np.flatnonzero(rng.random(40) < 0.8).tolist():
            x, y = (places[i] + 0.5 * k * speeds[i]).tolist()
            size = (6.0, 6.0, 4.0) if "rack" in CATEGORIES[kinds[i]] else (4.0, 2.0, 1.5)
            points = int(rng.integers(0, 4))
            boxes.append(Box(f"i{i}", CATEGORIES[kinds[i]], (x, y, 1.0), size, float(0.1 * i), (), points))
        time_us = 500_000 * k + (2_000_000 if k > 3 else 0)  # after a gap no velocity is known
        sweeps.append(Sweep(time_us, np.ones((9, 4), np.float32), (1.0 * k, 0.5 * k, 0.3), tuple(boxes)))
    write_nuscenes(root, {NAME: sweeps})
    return nuscenes.read_scene(root / "v1.0-mini", NAME), sweeps


def random_results(scene, sweeps, seed):
    """The objects with errors, some twice, and false ones."""
    rng = np.random.default_rng(seed)
    results = {}
    for frame, token in scene.sample_of_frame().items():
        rows = []
        for n, box in enumerate([*sweeps[frame].boxes] * 2):
            name = {"vehicle.car": "car", "vehicle.bicycle": "bicycle"}.get(box.category, "pedestrian")
            if rng.random() < 0.4:
                continue
            rows.append(
                {
                    "sample_token": token,
                    "translation": (np.array(box.centre) + rng.normal(0, 0.8, 3)).tolist(),
                    "size": (np.array(box.size)[[1, 0, 2]] * rng.uniform(0.7, 1.3, 3)).tolist(),
                    "rotation": turned(box.yaw + float(rng.normal(0, 1))),
                    "velocity": rng.normal(0, 2, 2).tolist(),
                    "detection_name": name,
                    "detection_score": round(float(rng.random()), 2),  # some alike
                    "attribute_name": "",
                    "tracking_id": f"{box.instance}-{n}",
                    "tracking_name": name,
                    "tracking_score": 0.5,
                }
            )
        results[token] = rows
    return results


@pytest.mark.parametrize("seed", range(4))
def test_the_score_is_that_of_the_devkit(tmp_path, seed):
    devkit = pytest.importorskip("nuscenes", reason="needs nuscenes-devkit")
    from nuscenes.eval.common.config import config_factory
    from nuscenes.eval.detection.evaluate import DetectionEval

    scene, sweeps = random_scene(tmp_path, seed)
    results = random_results(scene, sweeps, seed)
    path = tmp_path / "results.json"
    path.write_text(json.dumps(submission(results, "detection")))
    data = devkit.NuScenes(version="v1.0-mini", dataroot=str(tmp_path), verbose=False)
    config = config_factory("detection_cvpr_2019")
    judge = DetectionEval(data, config, str(path), "mini_val", str(tmp_path / "judged"), verbose=False)
    metrics = judge.evaluate()[0].serialize()
    ours = scores([(scene, results)])
    for name, score in ours.items():
        errors = metrics["label_tp_errors"][name]
        theirs = (*(errors[f"{error}_err"] for error in ("trans", "scale", "orient", "vel")),)
        assert score.ap == pytest.approx(metrics["mean_dist_aps"][name], abs=1e-9)
        mine = (score.translation_m, score.scale, score.orientation_rad, score.velocity_mps)
        assert mine == pytest.approx(theirs, abs=1e-9)
    assert ours["car"].ap > 0.05


def test_results_of_tracking_are_read_by_the_devkit(tmp_path):
    pytest.importorskip("nuscenes", reason="needs nuscenes-devkit")
    pytest.importorskip("motmetrics", reason="needs motmetrics")
    from nuscenes.eval.common.config import config_factory
    from nuscenes.eval.common.loaders import load_prediction
    from nuscenes.eval.tracking.data_classes import TrackingBox

    scene, sweeps = random_scene(tmp_path, 0)
    path = tmp_path / "results.json"
    path.write_text(json.dumps(submission(random_results(scene, sweeps, 0), "tracking")))
    config_factory("tracking_nips_2019")  # without it no name is known
    boxes, meta = load_prediction(str(path), 500, TrackingBox)
    assert sorted(boxes.sample_tokens) == sorted(scene.sample_of_frame().values())
    assert meta["use_lidar"]


def test_what_is_exact_scores_everything(tmp_path):
    boxes = tuple(Box(f"i{k}", "vehicle.car", (5.0 * k, 3.0, 0.75)) for k in range(5))
    points = np.ones((9, 4), np.float32)
    root = write_nuscenes(tmp_path, {NAME: [Sweep(500_000 * k, points, boxes=boxes) for k in range(3)]})
    scene = nuscenes.read_scene(root / "v1.0-mini", NAME)
    exact = {"size": [2.0, 4.0, 1.5], "rotation": turned(0.0), "velocity": [0.0, 0.0], "detection_name": "car"}
    results = {
        token: [
            {"sample_token": token, "translation": list(box.centre), "detection_score": 0.9, **exact} for box in boxes
        ]
        for token in scene.sample_of_frame().values()
    }
    car = scores([(scene, results)])["car"]
    assert (car.objects, car.ap) == (15, pytest.approx(1.0))
    assert (car.translation_m, car.scale, car.orientation_rad, car.velocity_mps) == pytest.approx((0, 0, 0, 0))
    nothing = scores([(scene, {})])["car"]
    assert (nothing.objects, nothing.ap, nothing.velocity_mps) == (15, 0.0, 1.0)


def test_a_run_of_something_else_is_refused(tmp_path):
    for path in (None, tmp_path):
        with pytest.raises(MisuseError, match="was not made of a scene of nuScenes"):
            scene_of(path)


@pytest.mark.command
def test_a_run_is_exported_and_judged_alike(tmp_path, capsys):
    from modt_simulation.synthetic_stream import SyntheticStream

    sweeps = []
    for k, frame in enumerate(SyntheticStream("street", "hdl-32e", 1.0, 1)):
        points = frame.points[frame.points[:, :3].any(axis=1)].copy()
        boxes = (Box("i0", "vehicle.car", (108.0, 53.0, 1.0)),) if not k % 2 else None
        sweeps.append(Sweep(100_000 * k, points, (100.0, 50.0, 1.0), boxes))
    path = write_nuscenes(tmp_path / "data", {NAME: sweeps}) / NAME
    assert here("replay", path, "--labels", "--quiet", "--out", tmp_path / "run") == 0
    for task, field in (("detection", "attribute_name"), ("tracking", "tracking_id")):
        target = tmp_path / f"{task}.json"
        capsys.readouterr()
        assert here("export", tmp_path / "run", f"--nuscenes-{task}", target) == 0
        assert capsys.readouterr().out == f"5 frames: {target}\n"
        written = json.loads(target.read_text())
        assert len(written["results"]) == 5
        rows = [row for rows in written["results"].values() for row in rows]
        assert rows
        assert all(field in row for row in rows)
        assert np.linalg.norm(np.mean([row["translation"][:2] for row in rows], axis=0) - [100, 50]) < 40
        assert {row[f"{task}_name"] for row in rows} <= {"car", "pedestrian", "bicycle"}
    capsys.readouterr()
    assert here("evaluate", tmp_path / "run", path, "--json") == 0
    assert json.loads(capsys.readouterr().out)["nuscenes"]["car"]["objects"] == 5
    assert here("evaluate", tmp_path / "run", path) == 0
    assert "nuScenes' detection benchmark" in capsys.readouterr().out
