"""A classifier that a program brings."""

import runpy
from pathlib import Path

import numpy as np
import pytest

import modt
from modt.classes import CLASS_NAMES
from modt.classification.own_classifier import OwnClassifier
from modt.errors import MisuseError
from modt_simulation.synthetic_stream import SyntheticStream
from tests import results

ROOT = Path(__file__).resolve().parents[2]
FREQUENCY = np.array([0.7, 0.1, 0.1, 0.1])


def test_the_function_gets_the_points_of_the_proposals_in_their_order_and_likelihoods_become_posteriors():
    proposals = results.proposals([3, 5, 2])
    points = np.arange(40, dtype=np.float32).reshape(10, 4)
    seen = []

    def likelihoods(clouds):
        seen.extend(clouds)
        return [[1, 1, 1, 1], [0, 2, 2, 0]]

    found = OwnClassifier(likelihoods, FREQUENCY).classify(points, proposals, np.array([2, 0]))
    assert [cloud.tolist() for cloud in seen] == [points[8:10].tolist(), points[:3].tolist()]
    assert found == pytest.approx(np.array([FREQUENCY, [0, 0.5, 0.5, 0]]))


@pytest.mark.parametrize(
    "rows", [[[1, 1, 1]], [[1, 1, 1, 1]] * 2, [[0, 0, 0, 0]], [[1, -1, 1, 1]], [[np.nan, 1, 1, 1]]]
)
def test_what_is_no_likelihood_is_refused(rows):
    own = OwnClassifier(lambda clouds: rows, FREQUENCY)
    with pytest.raises(MisuseError, match="return a row of likelihoods of background, car"):
        own.classify(np.zeros((3, 4), np.float32), results.proposals([3]), np.array([0]))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["car", "pedestrian"])
def test_a_pipeline_reports_what_the_function_says(name):
    said = np.where(np.array(CLASS_NAMES) == name, 1e3, 1e-3)
    pipeline = modt.Pipeline.from_profile("vlp-16", classifier=lambda clouds: np.tile(said, (len(clouds), 1)))
    for frame in SyntheticStream("street", "vlp-16", 0.5, seed=3):
        found = pipeline.step(frame)
    reported = [row["object_class"] for row in found.as_dicts() if row["object_class"] != "background"]
    assert len(reported) > 20
    assert set(reported) == {name}


@pytest.mark.slow
def test_the_example_runs(capsys):
    runpy.run_path(str(ROOT / "examples" / "own_classifier.py"))
    assert {line.split()[1] for line in capsys.readouterr().out.splitlines()} >= {"car", "pedestrian"}
