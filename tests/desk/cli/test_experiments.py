import csv

import pytest

from tests.cli.commands import here, refusal

pytestmark = pytest.mark.command


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Results of swept experiments and of one that is not, with another profile beside the first."""
    out = tmp_path_factory.mktemp("results")
    other = out / "other.yaml"
    other.write_text("fusion:\n  start_frame: 1\n")
    words = ["evaluate", "--experiment", "table4", "fig11", "fig12", "--simulated", "2", "--seconds", "0.2"]
    assert here(*words, "--beside", other, "--out", out) == 0
    return out


def test_results_are_written_as_a_table_and_a_document(results):
    with (results / "results.csv").open() as file:
        rows = list(csv.DictReader(file))
    swept = {row["at"] for row in rows if row["experiment"] == "fig12" and row["quantity"] == "beta"}
    assert swept == {f"{metres}.0" for metres in range(10, 80, 10)}
    assert {(row["kind"], row["paper"]) for row in rows} == {("simulated", "")}, "beside no figure of the paper"
    assert [row["profile"] for row in rows].count("default") == len(rows) / 2
    page = (results / "results.md").read_text()
    assert all(f"## {title}" in page for title in ("Table IV", "Fig. 11", "Fig. 12"))


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--experiment", "table9", "--simulated", "1"], "table3"),
        (["--experiment", "table4"], "no drives"),
        (["RUN", "TRUTH", "--experiment", "table4"], "takes no runs"),
        (["--experiment", "table3", "--simulated", "1"], "none of the drives"),
        (["--experiment", "table4", "--simulated", "1", "--further", "table.csv"], "--further"),
    ],
)
def test_misuse_is_one_line(words, named, capsys, tmp_path):
    assert named in refusal(capsys, "evaluate", *words, "--out", tmp_path)
