"""The network in PyTorch, and its export to ONNX."""

import numpy as np
import pytest


@pytest.mark.parametrize("block_points", [1, 9, 768])
def test_max_pooled_linear_has_the_gradients_of_its_definition(block_points, monkeypatch):
    torch = pytest.importorskip("torch", reason="extra [train] is not installed")
    from modt_training import network
    from modt_training.network import MaxPooledLinear

    monkeypatch.setattr(network, "BLOCK_POINTS", block_points)
    torch.manual_seed(0)
    count = torch.tensor([1, 7, 30])
    x = torch.randn(38, 5, requires_grad=True)
    weight = torch.randn(11, 5, requires_grad=True)
    outward = torch.randn(3, 11)
    found = MaxPooledLinear.apply(x, weight, count)
    expected = torch.segment_reduce(x @ weight.T, "max", lengths=count, axis=0)
    assert torch.allclose(found, expected)
    for one, other in zip(
        torch.autograd.grad(found, (x, weight), outward),
        torch.autograd.grad(expected, (x, weight), outward),
        strict=True,
    ):
        assert torch.allclose(one, other, atol=1e-6)


@pytest.mark.parametrize("pool_first", [True, False])
def test_the_exported_network_equals_the_trained_one(pool_first, tmp_path):
    torch = pytest.importorskip("torch", reason="extra [train] is not installed")
    from modt.classification.network import Network
    from modt.model_file import ModelFile
    from modt_training.export_pointnet import graph
    from modt_training.network import PointNet as Trained

    torch.manual_seed(0)
    net = Trained()
    counts = torch.tensor([1, 5, 60, 400, 900])
    for _ in range(3):  # gives the normalisations something to hold
        net(torch.randn(int(counts.sum()), 3) * 1.5, counts)
    for norm in net.norms:
        torch.nn.init.normal_(norm.log_scale, 0, 0.3)
    net.eval()
    path = tmp_path / "net.onnx"
    path.write_bytes(graph(net.layers(), pool_first=pool_first).SerializeToString())
    exported = Network(ModelFile.read(path))
    for n in (1, 2, 17, 400, 1200):
        xyz = torch.randn(2 * n, 3) * 2
        expected = torch.softmax(net(xyz, torch.tensor([n, n])), dim=1).detach().numpy()
        np.testing.assert_allclose(exported.infer(xyz.reshape(2, n, 3).numpy()), expected, atol=1e-4)
