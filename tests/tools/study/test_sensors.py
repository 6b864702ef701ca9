"""The table over sensors."""

from modt.geometry import FieldOfView
from modt_desk.evaluation.evaluation import evaluation
from tools.study.drives import simulated
from tools.study.sensors import row, run


def test_a_row_has_every_figure_of_every_class():
    drive = simulated("crossing", "vlp-16", 1.0, 1)
    found = evaluation([run(drive, drive.profile, "efficient", FieldOfView(), 0)])
    cells = row("vlp-16", "efficient", found).strip("| ").split(" | ")
    assert cells[:2] == ["vlp-16", "efficient"]
    assert len(cells) == 11
    objects = [int(n) for n in cells[2].split(" / ")]
    assert min(objects) > 0
    for column in cells[3:7]:
        assert all(0 <= int(share) <= 100 for share in column.split(" / ") if share != "-")
    assert 0 < int(cells[-1]) < 60
