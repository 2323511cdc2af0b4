"""A baseline: one perceptron of two hidden layers for all outputs, on the features of a signal."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from surrogate.data.samples import Samples
from surrogate.learners.base import Estimate, Learner, Training, regression
from surrogate.learners.bayesian_network.min_max import MinMax, min_max, scaled, unscaled
from surrogate.learners.signal_features import Directions, carried, features, fit_directions, sound_components
from touchcal.arrays import Array

# Most directions that are inputs, hidden units of a layer, rate of the first step of Adam on all rows at once.
MOST, UNITS, RATE = 20, 128, 3e-3


@dataclass(frozen=True)
class Layer:
    """One affine map."""

    weight: Array  # (out, in)
    bias: Array  # (out,)


@dataclass(frozen=True)
class Mlp(Learner):
    """y = W2 tanh(W1 tanh(W0 f + b0) + b1) + b2 of features f, outputs scaled."""

    directions: Directions
    targets: MinMax
    layers: tuple[Layer, ...]
    variance: Array  # (outputs,) mean squared error of the training rows, in the outputs' units squared

    @classmethod
    def fit(cls, rows: Samples, training: Training) -> Mlp:
        """Fit by least squares: Adam with a rate that falls to zero."""
        target = rows.targets(training.names)
        directions = fit_directions(rows.signal_V, sound_components(rows.signal_V, MOST))
        targets, f = min_max(target), features(directions, rows.signal_V)
        layers = _fitted(f, scaled(targets, target), training.seed, training.epochs)
        error = unscaled(targets, _run(layers, f)[0]) - target
        return cls(directions, targets, layers, np.maximum(np.mean(error**2, axis=0), 1e-24))

    def estimate(self, signal_V: Array, noise_V: float) -> Estimate:
        """Outputs of signals (n, readings) under white noise, which the slopes carry to the outputs."""
        value, slope = _run(self.layers, features(self.directions, signal_V))
        half = self.targets.half_span
        return regression(unscaled(self.targets, value),
                          self.variance + carried(self.directions, signal_V, slope * half[:, None], noise_V))

    def record(self, training: Training) -> dict[str, Any]:
        """Directions that are inputs, units of a hidden layer, steps taken."""
        return {"components": len(self.directions.axes), "units": UNITS, "steps": training.epochs}


def _run(layers: tuple[Layer, ...], f: Array) -> tuple[Array, Array]:
    """Scaled outputs (n, outputs) and their derivative (n, outputs, q) by the features."""
    first, second, last = layers
    near = np.tanh(f @ first.weight.T + first.bias)
    deep = np.tanh(near @ second.weight.T + second.bias)
    slope = (last.weight * (1 - deep**2)[:, None, :]) @ second.weight * (1 - near**2)[:, None, :] @ first.weight
    return deep @ last.weight.T + last.bias, slope


def _fitted(f: Array, y: Array, seed: int, steps: int) -> tuple[Layer, ...]:
    import torch
    from torch import nn
    from torch.nn.functional import mse_loss

    sizes = [f.shape[1], UNITS, UNITS, y.shape[1]]
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        linear = [nn.Linear(a, b) for a, b in pairwise(sizes)]
    net = nn.Sequential(linear[0], nn.Tanh(), linear[1], nn.Tanh(), linear[2])
    x, requested = torch.from_numpy(f).float(), torch.from_numpy(y).float()
    descent = torch.optim.Adam(net.parameters(), RATE)
    rate = torch.optim.lr_scheduler.CosineAnnealingLR(descent, steps)
    for _ in range(steps):
        descent.zero_grad()
        mse_loss(net(x), requested).backward()
        descent.step()
        rate.step()
    return tuple(Layer(part.weight.detach().double().numpy(), part.bias.detach().double().numpy()) for part in linear)
