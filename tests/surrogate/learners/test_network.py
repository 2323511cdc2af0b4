import numpy as np
import pytest

from surrogate.learners.bayesian_network import layer
from touchcal.arrays import Array


@pytest.fixture
def case() -> tuple[Array, Array]:
    rng = np.random.default_rng(4)
    return layer.initial_weights(7, 5, rng), rng.uniform(-1, 1, (11, 7))


def test_the_size_of_the_papers_network() -> None:
    assert len(layer.initial_weights(208, 20, np.random.default_rng(0))) == 4201


def test_jacobian_equals_automatic_differentiation(case: tuple[Array, Array]) -> None:
    torch = pytest.importorskip("torch")
    w, x = (torch.from_numpy(one) for one in case)

    def output(v):
        inner, bias, outer = torch.split(v[:-1], [35, 5, 5])
        return torch.tanh(x @ inner.reshape(5, 7).T + bias) @ outer + v[-1]

    assert np.allclose(output(w).numpy(), layer.output(*case), rtol=1e-13)
    assert np.allclose(layer.jacobian(*case), torch.func.jacrev(output)(w).numpy(), rtol=1e-12, atol=1e-14)


def test_jacobian_equals_finite_differences(case: tuple[Array, Array]) -> None:
    w, x = case
    h = 1e-6
    steps = [(layer.output(w + move, x) - layer.output(w - move, x)) / (2 * h) for move in h * np.eye(len(w))]
    assert np.allclose(layer.jacobian(w, x), np.stack(steps, axis=1), atol=1e-9)


def test_products_never_need_the_jacobian(case: tuple[Array, Array]) -> None:
    w, x = case
    j = layer.jacobian(w, x)
    assert np.allclose(layer.kernel(w, x), j @ j.T, rtol=1e-12)
    assert np.allclose(np.tril(layer.normal(w, x)), np.tril(j.T @ j), rtol=1e-12)
    direction, rows = np.linspace(-1, 2, len(w)), np.linspace(-3, 1, len(x))
    assert np.allclose(layer.times_jacobian(w, x, direction), j @ direction, rtol=1e-11)
    assert np.allclose(layer.times_transpose(w, x, rows), j.T @ rows, rtol=1e-11)
