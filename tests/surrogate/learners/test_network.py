from __future__ import annotations

import numpy as np
import pytest
import torch

from surrogate.learners.bayesian_network import layer


@pytest.fixture
def case() -> tuple[torch.Tensor, torch.Tensor]:
    generator = torch.Generator().manual_seed(4)
    w = layer.initial_weights(7, 5, generator)
    return w, 2 * torch.rand(11, 7, generator=generator, dtype=torch.float64) - 1


def test_the_size_of_the_papers_network() -> None:
    assert len(layer.initial_weights(208, 20, torch.Generator().manual_seed(0))) == 4201


def test_jacobian_equals_automatic_differentiation(case: tuple[torch.Tensor, torch.Tensor]) -> None:
    w, x = case
    exact = torch.func.jacrev(lambda v: layer.output(v, x))(w)
    assert torch.allclose(layer.jacobian(w, x), exact, rtol=1e-12, atol=1e-14)


def test_jacobian_equals_finite_differences(case: tuple[torch.Tensor, torch.Tensor]) -> None:
    w, x = case
    h = 1e-6
    moves = h * torch.eye(len(w), dtype=torch.float64)
    steps = [(layer.output(w + move, x) - layer.output(w - move, x)) / (2 * h) for move in moves]
    assert torch.allclose(layer.jacobian(w, x), torch.stack(steps, dim=1), atol=1e-9)


def test_products_never_need_the_jacobian(case: tuple[torch.Tensor, torch.Tensor]) -> None:
    w, x = case
    j = layer.jacobian(w, x)
    assert torch.allclose(layer.kernel(w, x), j @ j.T, rtol=1e-12)
    assert np.allclose(np.tril(layer.normal(w, x)), np.tril((j.T @ j).numpy()), rtol=1e-12)
    direction, rows = torch.linspace(-1, 2, len(w)).double(), torch.linspace(-3, 1, len(x)).double()
    assert torch.allclose(layer.times_jacobian(w, x, direction), j @ direction, rtol=1e-11)
    assert torch.allclose(layer.times_transpose(w, x, rows), j.T @ rows, rtol=1e-11)
