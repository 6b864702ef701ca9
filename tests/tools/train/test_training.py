"""The tools that make data and models."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.classes import ObjectClass
from modt.classification.crops import Crops, gather
from modt.geometry import FieldOfView
from modt.types import N_REFLECTANCE, NONE, Proposals
from tests.classification.scenes import blobs
from tests.tools.train.datasets import data_of
from tools.train.augment import Beams, augment, limit
from tools.train.build_crops import label
from tools.train.dataset import SHIPPED, SYNTHETIC, UNLABELLED, folds
from tools.train.held_out import cross_validated
from tools.train.labelled_scans import Scan, argoverse_scans, inside
from tools.train.paste import Item, pasted
from tools.train.scores import average_precision, confusion
from tools.train.temperature import Calibration, expected_error, fit

EVERYWHERE = FieldOfView()


def scan_of(points: np.ndarray, objects: list[np.ndarray], kinds: list[ObjectClass], unlabelled: np.ndarray) -> Scan:
    boxes = np.full((len(objects), 7), np.nan)
    return Scan("scan", "drive", points, tuple(objects), tuple(kinds), boxes, EVERYWHERE, unlabelled)


@given(counts=st.lists(st.integers(6, 300), min_size=1, max_size=8), seed=st.integers(0, 200))
def test_augmented_crops_keep_their_number_and_enough_points(counts: list[int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    points, proposals = blobs(counts, rng)
    crops = gather(points, proposals, np.arange(len(counts)), 1000)
    seen = limit(augment(crops, Beams(), rng), 50, rng)
    assert len(seen) == len(counts)
    assert (seen.count >= 6).all()
    assert (seen.count <= np.minimum(counts, 50)).all()
    assert np.isfinite(seen.xyz).all()


def test_augmentation_repeats_itself_from_its_seed() -> None:
    points, proposals = blobs([40, 200], np.random.default_rng(0))
    crops = gather(points, proposals, np.arange(2), 1000)
    once, again = (augment(crops, Beams(), np.random.default_rng(5)) for _ in range(2))
    assert once.xyz.tobytes() == again.xyz.tobytes()


def test_a_proposal_is_what_it_mostly_shows_and_mostly_covers() -> None:
    points = np.zeros((40, 4), np.float32)
    offsets = np.array([0, 10, 20, 30, 40])
    box, none = np.zeros((4, 7)), np.zeros(4, np.bool_)
    proposals = Proposals(np.arange(40), offsets, points[:, :3].T, np.zeros((4, 3)), box, none)
    car = np.arange(0, 9)  # nearly the first proposal
    walker = np.arange(10, 14)  # too few points to count
    rider = np.arange(17, 40)  # three points of the second, all of the third and of the fourth: neither is whole
    unlabelled = np.zeros(40, np.bool_)
    kinds = [ObjectClass.CAR, ObjectClass.PEDESTRIAN, ObjectClass.CYCLIST]
    labels = label(scan_of(points, [car, walker, rider], kinds, unlabelled), proposals)
    assert labels.kind.tolist() == [ObjectClass.CAR, 0, 0, 0]
    assert labels.partial.tolist() == [False, True, True, True]
    assert labels.unknown.tolist() == [True, False, False, False]  # nine points are too few to be judged by


def test_what_nobody_labelled_is_unknown() -> None:
    points = np.zeros((40, 4), np.float32)
    box, none = np.zeros((4, 7)), np.zeros(4, np.bool_)
    proposals = Proposals(np.arange(40), np.array([0, 10, 20, 30, 40]), points[:, :3].T, np.zeros((4, 3)), box, none)
    unlabelled = np.arange(40) >= 10
    assert label(scan_of(points, [], [], unlabelled), proposals).unknown.tolist() == [False, True, True, True]


def test_an_object_that_is_to_be_found_is_judged_where_labels_end_as_well() -> None:
    points = np.zeros((40, 4), np.float32)
    box, none = np.zeros((2, 7)), np.zeros(2, np.bool_)
    proposals = Proposals(np.arange(40), np.array([0, 20, 40]), points[:, :3].T, np.zeros((2, 3)), box, none[:2])
    unlabelled = np.tile(np.arange(20) >= 5, 2)  # of both, most lies there
    labels = label(scan_of(points, [np.arange(20)], [ObjectClass.CAR], unlabelled), proposals)
    assert labels.kind.tolist() == [ObjectClass.CAR, 0]
    assert labels.unknown.tolist() == [False, True]


def test_argoverse_sweeps_are_moved_to_the_sensor(tmp_path: Path) -> None:
    car = np.array([11.35, 0.0, 0.5, 0.2], np.float32) + np.linspace(0, 1, 30)[:, None] * np.float32([0, 1, 0, 0])
    carrier = np.array([[1.4, 0.1, 1.0, 0.2]], np.float32)
    np.savez(tmp_path / "log_1.npz", points=np.concatenate([carrier, car]))
    (tmp_path / "log_1.csv").write_text(
        "category,track,x_m,y_m,z_centre_m,length_m,width_m,height_m,yaw_rad,points\n"
        "REGULAR_VEHICLE,a,11.5,0.5,0.4,4.0,1.8,1.5,1.57,30\n"
        "BICYCLE,b,5.0,5.0,0.4,1.6,0.6,1.1,0.0,9\n"
        "PEDESTRIAN,c,60.0,5.0,0.4,0.6,0.6,1.7,0.0,0\n"
    )
    (scan,) = argoverse_scans(tmp_path)
    assert scan.kinds == (ObjectClass.CAR, ObjectClass.BACKGROUND)
    assert scan.drive == "argoverse2/log"
    np.testing.assert_allclose(scan.points[0, :3], [10.0, 0.0, -0.9], atol=1e-5)
    np.testing.assert_allclose(scan.boxes[0, :3], [10.15, 0.5, -1.75], atol=1e-5)
    assert len(scan.objects[0]) == 30


def test_folds_split_what_is_judged_by_drive_and_learn_from_the_rest_always() -> None:
    drive = np.array([0, 0, 1, 2, 3, 4, 4, 5])  # the last two drives are synthetic
    variant = np.where(drive < 4, SHIPPED, SYNTHETIC)
    label = np.array([1, 0, 2, 1, 0, 1, 0, 3])
    crops = Crops(np.zeros((len(drive), 3), np.float32), np.arange(len(drive) + 1))
    data = data_of(
        crops, label, variant=variant, drive=drive, truth_label=np.array([1, 2, 1]), truth_drive=np.array([0, 1, 2])
    )
    fold = folds(data, 3)
    assert (fold[4:] == NONE).all()
    assert sorted(set(fold[:4].tolist())) == [0, 1, 2]
    assert len(set(fold[:3].tolist())) == 3  # the objects are spread


def test_inside_is_clear_of_the_ground_and_turned_with_the_box() -> None:
    box = np.array([10.0, 0.0, -1.7, 4.0, 2.0, 1.5, np.pi / 2])
    points = np.array([[10, 1.9, -1, 0], [11.9, 0, -1, 0], [10, 0, -1.6, 0], [10, 0, 0.5, 0]], np.float32)
    assert inside(points, box).tolist() == [True, False, False, False]


def test_a_pasted_object_stands_on_the_ground_and_hides_what_is_behind_it() -> None:
    rng = np.random.default_rng(0)
    azimuth, elevation = np.meshgrid(np.arange(-180, 180, 0.4), np.arange(-24, -1, 0.8))
    rho = 1.7 / np.tan(np.deg2rad(-elevation.ravel()))
    a = np.deg2rad(azimuth.ravel())
    ground = np.c_[rho * np.cos(a), rho * np.sin(a), np.full(len(a), -1.7), np.zeros(len(a))].astype(np.float32)
    body = np.c_[np.full(60, 12.0), rng.uniform(-0.3, 0.3, 60), rng.uniform(-1.6, 0, 60), np.zeros(60)]
    item = Item(body.astype(np.float32), np.array([12.0, 0, -1.7, 0.8, 0.8, 1.8, 0]), ObjectClass.PEDESTRIAN, "there")
    empty = scan_of(ground, [], [], np.zeros(len(ground), np.bool_))
    items = [item, *(Item(item.points, item.box, kind, "there") for kind in (ObjectClass.CAR, ObjectClass.CYCLIST))]
    made = list(pasted(empty, items, 8, rng))
    assert made
    scan = made[0]
    assert scan.drive == "there"
    assert len(scan.points) < len(ground) + sum(map(len, scan.objects))
    for own, box in zip(scan.objects, scan.boxes, strict=True):
        assert np.hypot(*scan.points[own, :2].T) == pytest.approx(np.hypot(*box[:2]), abs=1.0)
        assert not scan.unlabelled[own].any()
    assert scan.unlabelled.sum() == len(scan.points) - sum(map(len, scan.objects))


@given(
    st.lists(st.tuples(st.integers(0, 3), st.floats(0, 1)), min_size=1, max_size=40),
    st.integers(0, 5),
)
def test_average_precision_agrees_with_the_definition(rows: list[tuple[int, float]], missed: int) -> None:
    label = np.array([r[0] for r in rows])
    score = np.array([r[1] for r in rows])
    probability = np.c_[1 - score, score, np.zeros((len(rows), 2))]
    truth = np.bincount(label, minlength=4)
    truth[1] += missed
    order = np.argsort(-score, kind="stable")
    points, true = [], 0
    for k, i in enumerate(order, start=1):
        true += label[i] == 1
        points.append((true / max(truth[1], 1), true / k))
    area, before = 0.0, 0.0
    for k, (recall, _) in enumerate(points):
        area += (recall - before) * max(p for _, p in points[k:])
        before = recall
    assert average_precision(probability, label, truth)["car"] == pytest.approx(area, abs=1e-3)


def test_confusion_counts_true_by_called() -> None:
    probability = np.eye(4)[[0, 1, 1, 3]]
    assert confusion(probability, np.array([0, 1, 2, 3]))[2] == [0, 1, 0, 0]


def test_calibration_finds_the_temperature_and_what_is_common() -> None:
    rng = np.random.default_rng(0)
    true = rng.normal([2.0, 0, 0, 0], 2.0, (6000, 4))
    share = Calibration.none().apply(true)
    label = np.array([rng.choice(4, p=p) for p in share])
    distorted = 3 * (true - [2.0, 0, 0, 0])
    found = fit(distorted, label)
    assert found.temperature == pytest.approx(3.0, rel=0.1)
    assert found.offset[1:] == pytest.approx(np.full(3, -2.0), abs=0.2)
    assert expected_error(found.apply(distorted), label) < 0.02
    assert expected_error(Calibration.none().apply(distorted), label) > 0.1


def test_calibration_folds_into_the_last_layer() -> None:
    rng = np.random.default_rng(0)
    calibration = Calibration(1.7, np.array([0.0, -1.0, 0.5, 2.0]))
    x, weight, bias = rng.normal(size=(5, 8)), rng.normal(size=(8, 4)), rng.normal(size=4)
    folded = calibration.folded((weight, bias))
    np.testing.assert_allclose(
        Calibration.none().apply(x @ folded[0] + folded[1]), calibration.apply(x @ weight + bias), atol=1e-5
    )


def test_the_exported_network_is_the_trained_one(tmp_path_factory: pytest.TempPathFactory) -> None:
    torch = pytest.importorskip("torch", reason="extra [train] is not installed")
    from modt.classification.pointnet import PointNet
    from modt.config import ClassificationConfig, SensorConfig
    from tools.train.export_pointnet import graph
    from tools.train.network import PointNet as Trained

    torch.manual_seed(0)
    net = Trained()
    counts = torch.tensor([1, 5, 60, 400, 900])
    for _ in range(3):  # gives the normalisations something to hold
        net(torch.randn(int(counts.sum()), 3) * 1.5, counts)
    for norm in net.norms:
        torch.nn.init.normal_(norm.log_scale, 0, 0.3)
    net.eval()
    path = tmp_path_factory.mktemp("model") / "net.onnx"
    path.write_bytes(graph(net.layers()).SerializeToString())
    exported = PointNet(ClassificationConfig(model=str(path)), SensorConfig())
    for n in (1, 2, 17, 400, 1200):
        xyz = torch.randn(2 * n, 3) * 2
        expected = torch.softmax(net(xyz, torch.tensor([n, n])), dim=1).detach().numpy()
        np.testing.assert_allclose(exported.infer(xyz.reshape(2, n, 3).numpy()), expected, atol=1e-4)


def test_an_ensemble_teaches_its_mean_and_what_returns_say_of_crops_without_a_label() -> None:
    torch = pytest.importorskip("torch", reason="extra [train] is not installed")
    from tools.train.teaching import TRUST, Ensemble, Labels

    rng = np.random.default_rng(0)
    xyz, count, label = torch.randn(9, 3), torch.tensor([4, 3, 2]), np.array([1, 3])
    said = torch.tensor([[[9.0, 0, 0, 0], [0, 9, 0, 0], [0, 0, 0, 9]], [[9, 0, 0, 0], [0, 0, 9, 0], [0, 0, 0, 9]]])
    evidence = rng.normal(size=(90, 4))
    ensemble = Ensemble([lambda xyz, count, own=own: own for own in said], np.arange(70, 90), 5, evidence)
    assert (np.isin(ensemble.further(rng), np.arange(70, 90))).all()
    assert len(ensemble.further(rng)) == 5
    expected = torch.softmax(said, dim=2).mean(dim=0)
    expected[2] *= torch.from_numpy(np.exp(TRUST * evidence[77]))
    expected[2] /= expected[2].sum()
    assert torch.allclose(ensemble.targets(xyz, count, label, np.array([77])), expected)
    assert len(Ensemble([], np.zeros(0, np.int64), 5, evidence).further(rng)) == 0
    assert len(Labels().further(rng)) == 0
    told = Labels().targets(xyz[:7], count[:2], label, np.zeros(0, np.int64))
    assert told.argmax(dim=1).tolist() == label.tolist()
    assert torch.allclose(told.sum(dim=1), torch.ones(2))


def test_returns_teach_nothing_where_a_class_shows_none() -> None:
    pytest.importorskip("torch", reason="extra [train] is not installed")
    from tools.train.train_pointnet import evidence_of_returns

    told = np.full((4, N_REFLECTANCE), 0.3)
    told[1:] = np.nan  # background alone
    data = data_of(Crops(np.zeros((4, 3), np.float32), np.arange(5)), np.arange(4), reflectance=told)
    assert not evidence_of_returns(data, np.arange(4), 0).any()


def test_the_maximum_of_a_linear_layer_has_the_gradients_of_its_definition() -> None:
    torch = pytest.importorskip("torch", reason="extra [train] is not installed")
    from tools.train.network import MaxOfLinear

    torch.manual_seed(0)
    count = torch.tensor([1, 7, 30])
    x, weight = torch.randn(38, 5, requires_grad=True), torch.randn(11, 5, requires_grad=True)
    outward = torch.randn(3, 11)
    found = MaxOfLinear.apply(x, weight, count)
    expected = torch.segment_reduce(x @ weight.T, "max", lengths=count, axis=0)
    assert torch.allclose(found, expected)
    for one, other in zip(
        torch.autograd.grad(found, (x, weight), outward),
        torch.autograd.grad(expected, (x, weight), outward),
        strict=True,
    ):
        assert torch.allclose(one, other, atol=1e-6)


def test_labels_are_learnt_from_where_there_are_any() -> None:
    partial, unknown = np.array([False, False, False, True]), np.array([True, False, True, False])
    variant = np.array([UNLABELLED, SHIPPED, SHIPPED, SHIPPED])
    crops = Crops(np.zeros((4, 3), np.float32), np.arange(5))
    data = data_of(crops, np.array([0, 0, 1, 0]), partial=partial, unknown=unknown, variant=variant)
    assert data.clear.tolist() == [False, True, True, False]


def test_no_model_judges_a_drive_that_it_learnt_from() -> None:
    drive = np.repeat(np.arange(6), 5)
    label = np.tile(np.arange(5) % 4, 6)
    crops = Crops(np.zeros((30, 3), np.float32), np.arange(31))
    data = data_of(crops, label, drive=drive, truth_label=label, truth_drive=drive)
    judged = []

    def trained(among: np.ndarray, i: int) -> Callable[[np.ndarray], np.ndarray]:
        def model(rows: np.ndarray) -> np.ndarray:
            assert not np.isin(drive[rows], drive[among]).any()
            judged.extend(rows.tolist())
            return np.eye(4)[label[rows]] * (i + 1)

        return model

    held = cross_validated(data, 3, trained)
    assert sorted(judged) == list(range(30))
    assert (held.logits.argmax(axis=1) == held.label).all()
    assert held.truth.tolist() == np.bincount(label).tolist()


def test_the_textbook_graph_says_what_ours_does() -> None:
    pytest.importorskip("onnx", reason="extra [train] is not installed")
    from modt.classification.pointnet import PointNet
    from modt.config import ClassificationConfig, SensorConfig
    from tools.bench.classification import bare, textbook

    shipped = PointNet(ClassificationConfig(), SensorConfig())
    naive, ours = (bare(shipped, SensorConfig(), pool_first=first) for first in (False, True))
    points, proposals = blobs([6, 40, 128], np.random.default_rng(1))
    expected = ours.classify(points, proposals, np.arange(3))
    np.testing.assert_allclose(textbook(naive, points, proposals, 2, SensorConfig()), expected, atol=1e-5)
