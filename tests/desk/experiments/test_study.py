import pytest

from modt_desk.experiments.catalogue import EXPERIMENTS, chosen
from modt_desk.experiments.drives import simulated_drives
from modt_desk.experiments.study import Study


def test_a_replay_that_experiments_share_is_made_once():
    names, drives = ["table5", "fig14", "table6"], simulated_drives(1, 0.4)
    apart = [Study([EXPERIMENTS[name]], drives, [()]).tasks() for name in names]
    assert [len(tasks) for tasks in apart] == [2, 2, 2]
    assert len(Study(chosen(names), drives, [()]).tasks()) == 3, "conventional, accurate and efficient"


def test_drives_and_profiles_have_tasks_of_their_own():
    study = Study(chosen(["fig11"]), simulated_drives(2, 0.4), [(), ("small-robot",)])
    assert len(study.tasks()) == 4 * len(Study(study.experiments, study.drives[:1], [()]).tasks())


@pytest.mark.slow
def test_several_processes_give_the_same_rows():
    done = []
    study = Study(chosen(["table5"]), simulated_drives(2, 0.2), [(), ("paper",)])
    assert study.rows(2, done.append) == study.rows(1, done.append)
    assert len(done) == 2 * len(study.tasks())
