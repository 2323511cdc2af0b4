"""Bayesian regularisation: Levenberg-Marquardt on beta E_D + alpha E_W, both weights of the sum set by the evidence.

E_D = sum of squared errors, E_W = sum of squared weights. With H = beta J'J + alpha I (half the Hessian), the number of
effective parameters is gamma = p - alpha tr H^-1, and alpha = gamma / (2 E_W), beta = (N - gamma) / (2 E_D) after each
accepted step (MacKay 1992, doi:10.1162/neco.1992.4.3.415; Foresee and Hagan 1997, doi:10.1109/ICNN.1997.614194).
Whichever of the N x N and p x p systems is smaller is solved.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from surrogate import network
from surrogate.laplace import effective_parameters, factor, log_evidence

# A network that leaves more than this part of the targets' variance unexplained has collapsed onto their mean.
COLLAPSED = 0.9
# alpha of a warm-up, with beta = 1
WARM_ALPHA = 0.01


@dataclass(frozen=True)
class Options:
    """How to train; the defaults are those usual for Bayesian regularisation."""

    # hidden units
    units: int = 20
    # most accepted steps
    epochs: int = 1000
    # damping: start, factor after an accepted and after a refused step, and the value that ends the training
    mu: float = 0.005
    mu_decrease: float = 0.1
    mu_increase: float = 10.0
    mu_max: float = 1e10
    # gradient norm that ends the training
    min_gradient: float = 1e-7
    # new starts that may follow a collapse, and the first steps of each in which alpha and beta are held
    restarts: int = 2
    warm_up: int = 20


@dataclass(frozen=True)
class Trained:
    """A trained network and how it came about."""

    # (p,) weights
    weights: Tensor
    alpha: float
    beta: float
    # effective number of parameters
    gamma: float
    # accepted steps
    epochs: int
    # why the training ended: "epochs", "mu_max", "min_gradient" or "collapsed" (gamma below 0.001)
    stop: str
    # log evidence up to the same constant for every network of one size on one data set
    log_evidence: float
    # starts that collapsed, this one included
    collapses: int
    # whether this one did: it then says little more than the mean of the targets
    collapsed: bool
    # (epochs, 3) of E_D, E_W and gamma after each step
    history: Tensor


@dataclass(frozen=True)
class _State:
    weights: Tensor
    alpha: float
    beta: float
    # (n,) outputs minus targets
    error: Tensor

    @property
    def squared_error(self) -> float:
        return float(self.error @ self.error)

    @property
    def squared_weights(self) -> float:
        return float(self.weights @ self.weights)

    @property
    def cost(self) -> float:
        return self.beta * self.squared_error + self.alpha * self.squared_weights


def train(x: Tensor, y: Tensor, seed: int, options: Options | None = None) -> Trained:
    """Train on inputs (n, q) in [-1, 1] and targets (n,) in [-1, 1].

    The first start follows the method to the letter. A start that collapses, its evidence driving every weight to zero,
    is followed by others with a warm-up; where all collapse the last is returned, marked.
    """
    options = options or Options()
    generator = torch.Generator().manual_seed(seed)
    trained = _train_once(x, y, generator, options, attempt=0)
    while trained.collapsed and trained.collapses <= options.restarts:
        trained = _train_once(x, y, generator, options, attempt=trained.collapses)
    return trained


def _train_once(x: Tensor, y: Tensor, generator: torch.Generator, options: Options, attempt: int) -> Trained:
    """One start; those after the first have a warm-up."""
    start = _first_state(x, y, network.initial_weights(x.shape[1], options.units, generator), warm=attempt > 0)
    state, gamma, stop, history = _descend(x, y, start, options, options.warm_up if attempt else 0)
    collapsed = state.squared_error >= COLLAPSED * float(((y - y.mean()) ** 2).sum())
    evidence = log_evidence(state.weights, x, state.alpha, state.beta, state.cost)
    return Trained(state.weights, state.alpha, state.beta, gamma, len(history), stop, evidence, attempt + collapsed,
                   collapsed, torch.tensor(history, dtype=torch.float64).reshape(-1, 3))


def _descend(x: Tensor, y: Tensor, state: _State, options: Options,
             warm_up: int) -> tuple[_State, float, str, list[list[float]]]:
    """Steps until one of the stopping rules holds; returns the state, gamma, the rule and the history."""
    mu, history, gamma = options.mu, [], float(len(state.weights))
    while len(history) < options.epochs:
        gradient = state.beta * network.times_transpose(state.weights, x, state.error) + state.alpha * state.weights
        if 2 * float(gradient.norm()) < options.min_gradient:
            return state, gamma, "min_gradient", history
        trial, mu = _accepted(x, y, state, _damped_step(x, state), mu, options)
        if trial is None:
            return state, gamma, "mu_max", history
        state = trial
        if len(history) >= warm_up:
            gamma, left = effective_parameters(trial.weights, x, trial.alpha, trial.beta)
            state = replace(trial, alpha=gamma / (2 * trial.squared_weights), beta=left / (2 * trial.squared_error))
        history.append([state.squared_error, state.squared_weights, gamma])
        if gamma < 1e-3:
            return state, gamma, "collapsed", history
    return state, gamma, "epochs", history


def _first_state(x: Tensor, y: Tensor, start: Tensor, warm: bool) -> _State:
    """gamma = p at first, where the data allow it, else beta = 1; a warm start fits the data almost freely."""
    error = network.output(start, x) - y
    if warm:
        return _State(start, WARM_ALPHA, 1.0, error)
    left = len(y) - len(start)
    beta = left / (2 * float(error @ error)) if left > 0 else 1.0
    return _State(start, len(start) / (2 * float(start @ start)), beta, error)


def _accepted(x: Tensor, y: Tensor, state: _State, step_at: Callable[[float], Tensor], mu: float,
              options: Options) -> tuple[_State | None, float]:
    """The first step of growing damping that lowers the cost, and the next damping; None beyond mu_max."""
    while mu <= options.mu_max:
        weights = state.weights + step_at(mu)
        trial = _State(weights, state.alpha, state.beta, network.output(weights, x) - y)
        if trial.cost < state.cost:
            return trial, max(mu * options.mu_decrease, 1e-20)
        mu *= options.mu_increase
    return None, mu


def _damped_step(x: Tensor, state: _State) -> Callable[[float], Tensor]:
    """mu -> -(beta J'J + (alpha + mu) I)^-1 (beta J'e + alpha w), by the smaller of the two systems."""
    w, alpha, beta, error = state.weights, state.alpha, state.beta, state.error
    if len(x) < len(w):
        gram, along = beta * network.kernel(w, x, x), network.times_jacobian(w, x, w)

        def dual(mu: float) -> Tensor:
            shift = alpha + mu
            rows = torch.cholesky_solve((error - alpha / shift * along)[:, None], factor(gram, shift))[:, 0]
            return -beta * network.times_transpose(w, x, rows) - alpha / shift * w

        return dual
    j = network.jacobian(w, x)
    normal, gradient = beta * j.T @ j, beta * j.T @ error + alpha * w
    return lambda mu: -torch.cholesky_solve(gradient[:, None], factor(normal, alpha + mu))[:, 0]
