"""One hidden layer of tanh units and one linear output, float64, with its Jacobian by the weights in closed form.

y(x) = v . tanh(W x + b) + c. All weights in one vector w = (W by rows, b, v, c), p = h (q + 2) + 1 numbers for q inputs
and h units. The Jacobian J is n x p; products with it and the n x n matrix J J' never need it whole.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from surrogate.learners.bayesian_network.normal_equations import normal_matrix
from touchcal.arrays import Array

torch.set_num_threads(1)


@dataclass(frozen=True)
class Layers:
    """The weight vector cut into its layers (views)."""

    inner: Tensor  # (h, q) input weights W
    bias: Tensor  # (h,) biases b
    outer: Tensor  # (h,) output weights v
    offset: Tensor  # () output bias c


def count_weights(inputs: int, units: int) -> int:
    """p = h (q + 2) + 1."""
    return units * (inputs + 2) + 1


def layers(w: Tensor, inputs: int) -> Layers:
    """Cut a weight vector (p,) of a network with `inputs` inputs."""
    units = (len(w) - 1) // (inputs + 2)
    inner, bias, outer = torch.split(w[:-1], [units * inputs, units, units])
    return Layers(inner.reshape(units, inputs), bias, outer, w[-1])


def initial_weights(inputs: int, units: int, generator: torch.Generator) -> Tensor:
    """Nguyen-Widrow start for inputs in [-1, 1], as trainbr's networks have it: units of gain 1.4 h^(1/q), active where
    |w x + b| < 2, spread over the inputs (Nguyen and Widrow 1990); output weights uniform in [-1, 1]."""
    gain = 2 * 0.7 * units ** (1.0 / inputs)
    inner = 2 * torch.rand(units, inputs, generator=generator, dtype=torch.float64) - 1
    inner *= gain / inner.norm(dim=1, keepdim=True)
    spread = torch.linspace(-1, 1, units, dtype=torch.float64) if units > 1 else torch.zeros(1, dtype=torch.float64)
    outer = 2 * torch.rand(units + 1, generator=generator, dtype=torch.float64) - 1
    return torch.cat([inner.flatten(), gain * spread * torch.sign(inner[:, 0]), outer])


def turned(w: Tensor, axes: Tensor) -> Tensor:
    """The network on inputs x axes, for axes (q, r): input weights W axes, the others as they are."""
    net = layers(w, len(axes))
    return torch.cat([(net.inner @ axes).flatten(), w[net.inner.numel():]])


def output(w: Tensor, x: Tensor) -> Tensor:
    """(n,) outputs for inputs (n, q)."""
    net = layers(w, x.shape[1])
    return torch.tanh(x @ net.inner.T + net.bias) @ net.outer + net.offset


def jacobian(w: Tensor, x: Tensor) -> Tensor:
    """(n, p) derivative of the outputs by the weights."""
    hidden, slope = _hidden(w, x)
    inner = (slope[:, :, None] * x[:, None, :]).flatten(1)
    return torch.cat([inner, slope, hidden, x.new_ones(len(x), 1)], dim=1)


def by_input(w: Tensor, x: Tensor) -> Tensor:
    """(n, q) derivative of the outputs by the inputs."""
    return _hidden(w, x)[1] @ layers(w, x.shape[1]).inner


def kernel(w: Tensor, x: Tensor, z: Tensor) -> Tensor:
    """(n, m) J(x) J(z)', without forming either Jacobian."""
    hidden_x, slope_x = _hidden(w, x)
    hidden_z, slope_z = _hidden(w, z)
    return (slope_x @ slope_z.T) * (1 + x @ z.T) + hidden_x @ hidden_z.T + 1


def self_kernel(w: Tensor, x: Tensor) -> Tensor:
    """(n,) squared norm of each row of J(x)."""
    hidden, slope = _hidden(w, x)
    return (slope**2).sum(1) * (1 + (x**2).sum(1)) + (hidden**2).sum(1) + 1


def normal(w: Tensor, x: Tensor) -> Array:
    """(p, p) lower triangle of J'J, without forming J."""
    hidden, slope = _hidden(w, x)
    return normal_matrix(x.numpy(), hidden.numpy(), slope.numpy())


def times_jacobian(w: Tensor, x: Tensor, direction: Tensor) -> Tensor:
    """(n,) J direction, for a direction (p,)."""
    hidden, slope = _hidden(w, x)
    move = layers(direction, x.shape[1])
    return (slope * (x @ move.inner.T + move.bias)).sum(1) + hidden @ move.outer + move.offset


def times_transpose(w: Tensor, x: Tensor, rows: Tensor) -> Tensor:
    """(p,) J' rows, for rows (n,)."""
    hidden, slope = _hidden(w, x)
    weighted = slope * rows[:, None]
    return torch.cat([(weighted.T @ x).flatten(), weighted.sum(0), rows @ hidden, rows.sum()[None]])


def _hidden(w: Tensor, x: Tensor) -> tuple[Tensor, Tensor]:
    """Hidden outputs (n, h) and output weight times tanh' (n, h)."""
    net = layers(w, x.shape[1])
    hidden = torch.tanh(x @ net.inner.T + net.bias)
    return hidden, net.outer * (1 - hidden**2)
