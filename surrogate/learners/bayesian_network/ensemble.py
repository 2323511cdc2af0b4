"""Networks of one output each on shared inputs, trained by their evidence, with the spread that their weights leave."""

import multiprocessing
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from surrogate.learners.bayesian_network import bayesian_regularisation, laplace
from surrogate.learners.bayesian_network.bayesian_regularisation import Options, Training
from surrogate.learners.bayesian_network.min_max import MinMax, min_max, scaled, unscaled
from touchcal.arrays import Array

# Draws of the weights that tell the spread of an output; its standard deviation is then known within 1 / sqrt(2 DRAWS),
# an eighth, before calibration.
DRAWS = 32
BATCH = 256  # rows predicted together, to bound the memory


@dataclass(frozen=True)
class Networks:
    """Trained networks, all of one size."""

    inputs: int  # inputs q of each network
    targets: MinMax  # scaling of the outputs
    weights: Array  # (outputs, p) weights as layer.layers cuts them
    draws: NDArray[np.float32]  # (outputs, DRAWS, p) departures from them, normal with the Laplace covariance, float32
    trainings: tuple[Training, ...]

    @property
    def layers(self) -> tuple[NDArray[np.floating], ...]:
        """W (outputs, h, q), b (outputs, h), v (outputs, h) and c (outputs,) of the networks."""
        return _cut(self.weights, self.inputs)


@dataclass(frozen=True)
class Prediction:
    """Outputs of some inputs in their own units."""

    value: Array  # (n, outputs)
    variance: Array  # (n, outputs) variance of model and target noise
    slope: Array  # (n, outputs, q) derivative by the inputs


def fit(x: Array, target: Array, seed: int, options: Options, workers: int = 1,
        each: Callable[[Iterable[int]], Iterable[int]] = iter) -> Networks:
    """Train one network for each column of target (n, outputs) on inputs (n, q) of about unit size.

    `workers` processes share the outputs; the networks are the same for any number of them. `each` may show progress.
    ValueError where a column of the targets does not vary.
    """
    targets = min_max(target)
    if np.any(targets.lowest == targets.highest):
        same = int(np.argmax(targets.lowest == targets.highest))
        raise ValueError(f"output {same + 1} of {target.shape[1]} is {targets.lowest[same]:g} in every training row; a "
                         "network has nothing to learn from it. Leave it out with `outputs`.")
    columns = list(scaled(targets, target).T.copy())
    train = partial(_train, x, seed, options)
    if workers > 1 and len(columns) > 1:
        with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
            found = pool.map(train, columns)
            trained = [next(found) for _ in each(range(len(columns)))]
    else:
        trained = [train(columns[i]) for i in each(range(len(columns)))]
    weights, draws, trainings = zip(*trained, strict=True)
    return Networks(x.shape[1], targets, np.array(weights), np.array(draws), trainings)


def record(networks: Networks, names: Sequence[str]) -> dict[str, Any]:
    """How the training of the network of each output of these names ended, as JSON."""
    keys = ("gamma", "alpha", "beta", "epochs", "stop", "log_evidence", "collapses", "collapsed")
    return {name: {key: getattr(training, key) for key in keys} | {"parameters": networks.weights.shape[1]}
            for name, training in zip(names, networks.trainings, strict=True)}


def _train(x: Array, seed: int, options: Options, y: Array) -> tuple[Array, NDArray[np.float32], Training]:
    with threadpool_limits(1):
        weights, training = bayesian_regularisation.train(x, y, seed, options)
        draws = laplace.draws(weights, x, training.alpha, training.beta, DRAWS, np.random.default_rng(seed))
    return weights, draws.astype(np.float32), training


def predict(networks: Networks, x: Array) -> Prediction:
    """Outputs of inputs (n, q)."""
    parts = [_predict(networks, x[i:i + BATCH]) for i in range(0, len(x), BATCH)]
    value, variance, slope = (np.concatenate([part[i] for part in parts]) for i in range(3))
    half = networks.targets.half_span
    return Prediction(unscaled(networks.targets, value), variance * half**2, slope * half[:, None])


def _predict(networks: Networks, x: Array) -> tuple[Array, Array, Array]:
    """Value, variance and slope in the scaled units of the targets."""
    inner, bias, outer, offset = networks.layers
    hidden = np.tanh(np.einsum("nq,khq->nkh", x, inner, optimize=True) + bias)
    gain = outer * (1 - hidden**2)
    value = np.einsum("nkh,kh->nk", hidden, outer) + offset
    slope = np.einsum("nkh,khq->nkq", gain, inner, optimize=True)
    inner, bias, outer, offset = _cut(networks.draws, networks.inputs)
    moved = np.einsum("nq,kshq->nksh", x.astype(np.float32), inner, optimize=True) + bias
    change = np.einsum("nksh,nkh->nks", moved, gain, optimize=True) + np.einsum("nkh,ksh->nks", hidden, outer) + offset
    noise = [0.5 / training.beta for training in networks.trainings]
    return value, np.mean(change**2, axis=2) + noise, slope


def _cut(weights: NDArray[np.floating], inputs: int) -> tuple[NDArray[np.floating], ...]:
    """Views of weight vectors (..., p): W (..., h, q), b (..., h), v (..., h), c (...), as layer.layers cuts one."""
    units = (weights.shape[-1] - 1) // (inputs + 2)
    inner, bias, outer, offset = np.split(weights, np.cumsum([units * inputs, units, units]), axis=-1)
    return inner.reshape(*weights.shape[:-1], units, inputs), bias, outer, offset[..., 0]
