"""The paper's networks (section 5.1): min-max voltages in, one hidden layer, one output, Bayesian regularisation."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from surrogate import evidence, laplace, network
from surrogate.estimate import Estimate
from surrogate.evidence import Options, Trained
from surrogate.scaling import MinMax, min_max, scaled, unscaled

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Network:
    """One output's network and how its training went."""

    # (p,) weights
    weights: Array
    alpha: float
    beta: float
    # effective number of parameters
    gamma: float
    # steps used, and why the training ended
    epochs: int
    stop: str
    log_evidence: float
    # starts that collapsed; `collapsed` says whether the last one did too
    collapses: int
    collapsed: bool
    # (epochs, 3) of E_D, E_W and gamma after each step
    history: Array


@dataclass(frozen=True)
class Networks:
    """One network an output on shared inputs.

    The inputs are min-max differences to the untouched frame: where the untouched voltages are the same in every row,
    as on one sensor, these equal the paper's min-max voltages exactly, and a frame of another baseline still serves.
    """

    # scaling of the readings, V, and of the outputs
    readings: MinMax
    targets: MinMax
    # (n, readings) scaled training inputs, which the Laplace variance needs
    inputs: Array
    networks: tuple[Network, ...]


def learn(signal_V: Array, target: Array, seed: int, options: Options | None = None,
          each: Callable[[Iterable[int]], Iterable[int]] = iter) -> Networks:
    """Train one network for each column of target (n, outputs) on signals (n, readings); `each` may show progress.

    ValueError where a column of the targets does not vary.
    """
    readings, targets = min_max(signal_V), min_max(target)
    if np.any(targets.lowest == targets.highest):
        same = int(np.argmax(targets.lowest == targets.highest))
        raise ValueError(f"output {same + 1} of {target.shape[1]} is {targets.lowest[same]:g} in every training row; a "
                         "network has nothing to learn from it. Leave it out with --outputs.")
    x, y = torch.from_numpy(scaled(readings, signal_V)), torch.from_numpy(scaled(targets, target))
    trained = tuple(_kept(evidence.train(x, y[:, i].contiguous(), seed, options)) for i in each(range(y.shape[1])))
    return Networks(readings, targets, x.numpy(), trained)


def _kept(trained: Trained) -> Network:
    return Network(trained.weights.numpy(), trained.alpha, trained.beta, trained.gamma, trained.epochs, trained.stop,
                   trained.log_evidence, trained.collapses, trained.collapsed, trained.history.numpy())


def estimate(networks: Networks, signal_V: Array, noise_V: float) -> Estimate:
    """Outputs of signals (n, readings) under white noise, which the networks' input slopes carry to the outputs."""
    x, at = torch.from_numpy(networks.inputs), torch.from_numpy(scaled(networks.readings, signal_V))
    noise = torch.from_numpy(noise_V / networks.readings.half_span)
    value, variance = [], []
    for net in networks.networks:
        w = torch.from_numpy(net.weights)
        carried = ((network.by_input(w, at) * noise) ** 2).sum(1)
        value.append(network.output(w, at).numpy())
        variance.append((laplace.output_variance(w, x, net.alpha, net.beta, at) + carried).numpy())
    half = networks.targets.half_span
    return Estimate(unscaled(networks.targets, np.column_stack(value)), np.sqrt(np.column_stack(variance)) * half,
                    np.ones(len(signal_V)), np.ones(len(signal_V), bool))
