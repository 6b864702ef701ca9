from __future__ import annotations

import dataclasses
from itertools import groupby

import pytest

from modt.errors import MisuseError, ModtError
from modt_desk.experiments.catalogue.every import EXPERIMENTS, chosen
from modt_desk.experiments.store import Store
from modt_desk.experiments.study import Row, Study
from modt_desk.experiments.units import Cluster, Executor, Here, Processes, Unit, work
from tests.desk.experiments.drives import short_drives

NAMES = ("table5",)


def rows(folder, executor: Executor, n: int = 2, frames: int = 3) -> list[Row]:
    study = Study(chosen(NAMES), short_drives(n, frames), [()], Store(folder))
    study.complete(executor, lambda unit: None)
    return study.rows()


def test_results_are_kept_and_an_interrupted_study_goes_on(tmp_path):
    study = Study(chosen(NAMES), short_drives(1, 3), [()], Store(tmp_path))
    total = study.missing

    def stop(unit):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        study.complete(Here(), stop)
    assert study.missing == total - 1
    study.complete(Here(), lambda unit: None)
    assert study.missing == 0
    done = []
    study.complete(Here(), done.append)
    assert not done


def test_a_broken_result_is_made_again(tmp_path):
    before = rows(tmp_path, Here(), n=1)
    for path in tmp_path.rglob("*.npz"):
        path.write_bytes(b"PK")
    assert rows(tmp_path, Here(), n=1) == before


def test_the_key_of_a_unit_follows_drive_replay_and_profile():
    (one, other), experiment = short_drives(2), EXPERIMENTS["fig11"]
    keys = {
        unit.key
        for drive, profiles in ((one, ()), (other, ()), (one, ("small-robot",)))
        for unit in Study([experiment], [drive], [profiles], Store(None)).units
    }
    assert len(keys) == 3 * len(Study([experiment], [one], [()], Store(None)).units)


def test_units_with_the_same_segmentation_and_network_follow_one_another():
    units = Study(chosen(["table5", "fig11"]), short_drives(2), [(), ("paper",)], Store(None)).units
    assert len(list(groupby(units, lambda unit: unit.basis))) == 4


def test_a_worker_with_other_code_is_refused(tmp_path):
    unit = Study(chosen(["table4"]), short_drives(1), [()], Store(tmp_path)).units[0]
    with pytest.raises(MisuseError, match="another version"):
        work(dataclasses.replace(unit, code="older"), tmp_path)


@pytest.mark.slow
def test_several_processes_give_the_same_rows(tmp_path):
    assert rows(tmp_path / "a", Processes(2)) == rows(tmp_path / "b", Here())


def test_a_cluster_needs_its_extra_or_a_scheduler(tmp_path):
    with pytest.raises(ModtError):
        rows(tmp_path, Cluster("tcp://127.0.0.1:1"), n=1)


@pytest.mark.slow
def test_a_cluster_gives_the_same_rows(tmp_path):
    distributed = pytest.importorskip("distributed", reason="extra 'cluster' is not installed")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        found = rows(tmp_path / "a", Cluster(cluster.scheduler_address), n=20, frames=1)
    assert found == rows(tmp_path / "b", Here(), n=20, frames=1)
    assert all(isinstance(unit, Unit) for unit in Study(chosen(NAMES), short_drives(1), [()], Store(tmp_path)).units)
