"""The network in PyTorch."""

from __future__ import annotations

import pytest


def test_max_pooled_linear_has_the_gradients_of_its_definition() -> None:
    torch = pytest.importorskip("torch", reason="extra [train] is not installed")
    from tools.train.network import MaxPooledLinear

    torch.manual_seed(0)
    count = torch.tensor([1, 7, 30])
    x, weight = torch.randn(38, 5, requires_grad=True), torch.randn(11, 5, requires_grad=True)
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
