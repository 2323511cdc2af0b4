"""Bayesian regularisation: Levenberg-Marquardt on beta E_D + alpha E_W, both weights of the sum set by the evidence.

E_D = sum of squared errors, E_W = sum of squared weights. With H = beta J'J + alpha I (half the Hessian), the number of
effective parameters is gamma = p - alpha tr H^-1, and alpha = gamma / (2 E_W), beta = (N - gamma) / (2 E_D) after each
accepted step (MacKay 1992, doi:10.1162/neco.1992.4.3.415; Foresee and Hagan 1997, doi:10.1109/ICNN.1997.614194).

E_W does not change where the inputs are turned, and inputs that never vary leave their weights at zero. So a network is
trained in the directions that its inputs take, and is the same network; then the smaller of the N x N and p x p systems
is solved. 208 readings take 104 directions where driving and reading pairs are interchangeable (reciprocity), of which
some 66 vary by more than LEAST_SPREAD of the widest. The others lie far below what the simulator knows of a signal; to
train without them is three times as fast from 2,800 rows, and changed errors on unseen rows by -5 to 2 %, no more than
another start does (1,400 rows, x0, d and F).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from surrogate.learners.bayesian_network import laplace, layer
from surrogate.learners.bayesian_network.laplace import Curvature, curvature, factor, solve
from touchcal.arrays import Array

# A network that leaves more than this part of the targets' variance unexplained has collapsed onto their mean.
COLLAPSED = 0.9
WARM_ALPHA = 0.01  # alpha of a warm-up, with beta = 1
LEAST_SPREAD = 1e-5  # Directions that the inputs spread along by less than that of the widest are left out.


@dataclass(frozen=True)
class Options:
    """How to train; the defaults are those of trainbr, to the letter but for the epochs."""

    units: int = 20  # hidden units
    # most accepted steps, where trainbr has 1,000; eight networks of 208 inputs on 2,800 rows then take some 14 minutes
    # on two cores, reckoned from 140 steps of two of them (0.7 CPU s each on a loaded machine)
    epochs: int = 300
    # damping: start, factor after an accepted and after a refused step, and the value that ends the training
    mu: float = 0.005
    mu_decrease: float = 0.1
    mu_increase: float = 10.0
    mu_max: float = 1e10
    min_gradient: float = 1e-7  # gradient norm that ends the training
    # new starts that may follow a collapse, and the first steps of these in which alpha and beta are held
    restarts: int = 0
    warm_up: int = 0


@dataclass(frozen=True)
class Training:
    """How the training of one network went."""

    alpha: float
    beta: float
    gamma: float  # effective number of parameters
    epochs: int  # accepted steps
    stop: str  # why the training ended: "epochs", "mu_max", "min_gradient" or "collapsed" (gamma below 0.001)
    log_evidence: float  # log evidence up to the same constant for every network of one size on one data set
    collapses: int  # starts that collapsed, the last one included
    collapsed: bool  # whether the last one did: the network then says little more than the mean of the targets
    history: Array  # (epochs, 5) of E_D, E_W, gamma (NaN while alpha and beta are held), alpha and beta after each step


@dataclass(frozen=True)
class _State:
    weights: Array
    alpha: float
    beta: float
    error: Array  # (n,) outputs minus targets

    @property
    def squared_error(self) -> float:
        return float(self.error @ self.error)

    @property
    def squared_weights(self) -> float:
        return float(self.weights @ self.weights)

    @property
    def cost(self) -> float:
        return self.beta * self.squared_error + self.alpha * self.squared_weights


def train(x: Array, y: Array, seed: int, options: Options | None = None,
          watch: Callable[[Array], None] | None = None) -> tuple[Array, Training]:
    """Weights (p,) of a network trained on inputs (n, q) and targets (n,), both in [-1, 1], and how it went.

    A start that collapses, its evidence driving every weight to zero, is followed by others where the options allow
    them; where all collapse the last is returned, marked. `watch` is shown the weights after every step.
    """
    options = options or Options()
    rng = np.random.default_rng(seed)
    axes = _directions(x)
    turned = x @ axes
    show = None if watch is None else lambda weights: watch(layer.turned(weights, axes.T))
    collapses = 0
    while True:
        start = layer.initial_weights(x.shape[1], options.units, rng)
        steps = options if collapses else replace(options, warm_up=0)
        first = _first_state(turned, y, start, layer.turned(start, axes), warm=steps.warm_up > 0)
        weights, training = _train_once(turned, y, first, steps, collapses, show)
        collapses = training.collapses
        if not training.collapsed or collapses > options.restarts:
            return layer.turned(weights, axes.T), training


def _directions(x: Array) -> Array:
    """(q, r) orthonormal axes along which the rows of x spread by more than LEAST_SPREAD of the widest."""
    _, singular, axes = np.linalg.svd(x, full_matrices=False)
    return np.ascontiguousarray(axes[singular > LEAST_SPREAD * singular[0]].T)


def _train_once(x: Array, y: Array, first: _State, options: Options, collapses: int,
                show: Callable[[Array], None] | None) -> tuple[Array, Training]:
    state, gamma, stop, history = _descend(x, y, first, options, show)
    collapsed = state.squared_error >= COLLAPSED * float(((y - y.mean()) ** 2).sum())
    evidence = laplace.log_evidence(curvature(state.weights, x), state.alpha, state.beta, state.cost)
    return state.weights, Training(state.alpha, state.beta, gamma, len(history), stop, evidence, collapses + collapsed,
                                   collapsed, np.array(history).reshape(-1, 5))


def _descend(x: Array, y: Array, state: _State, options: Options,
             show: Callable[[Array], None] | None) -> tuple[_State, float, str, list[list[float]]]:
    """Steps until one of the stopping rules holds; returns the state, gamma, the rule and the history."""
    mu, history, gamma = options.mu, [], float(len(state.weights))
    curved = curvature(state.weights, x)
    while len(history) < options.epochs:
        gradient = state.beta * layer.times_transpose(state.weights, x, state.error) + state.alpha * state.weights
        if 2 * float(np.linalg.norm(gradient)) < options.min_gradient:
            return state, gamma, "min_gradient", history
        trial, mu = _accepted(x, y, state, _damped_step(x, state, curved, gradient), mu, options)
        if trial is None:
            return state, gamma, "mu_max", history
        state, curved = trial, curvature(trial.weights, x)
        if len(history) >= options.warm_up:
            gamma, left = laplace.effective_parameters(curved, trial.alpha, trial.beta)
            state = replace(trial, alpha=gamma / (2 * trial.squared_weights), beta=left / (2 * trial.squared_error))
        known = gamma if len(history) >= options.warm_up else math.nan
        history.append([state.squared_error, state.squared_weights, known, state.alpha, state.beta])
        if show is not None:
            show(state.weights)
        if gamma < 1e-3:
            return state, gamma, "collapsed", history
    return state, gamma, "epochs", history


def _first_state(x: Array, y: Array, start: Array, turned: Array, warm: bool) -> _State:
    """Turned weights with gamma = p at first, p and E_W those of the start as drawn, and beta = 1 where that leaves no
    rows; a warm start fits the data almost freely."""
    error = layer.output(turned, x) - y
    if warm:
        return _State(turned, WARM_ALPHA, 1.0, error)
    left = len(y) - len(start)
    beta = left / (2 * float(error @ error)) if left > 0 else 1.0
    return _State(turned, len(start) / (2 * float(start @ start)), beta, error)


def _accepted(x: Array, y: Array, state: _State, step_at: Callable[[float], Array], mu: float,
              options: Options) -> tuple[_State | None, float]:
    """The first step of growing damping that lowers the cost, and the next damping; None above mu_max."""
    while mu <= options.mu_max:
        weights = state.weights + step_at(mu)
        trial = _State(weights, state.alpha, state.beta, layer.output(weights, x) - y)
        if trial.cost < state.cost:
            return trial, max(mu * options.mu_decrease, 1e-20)
        mu *= options.mu_increase
    return None, mu


def _damped_step(x: Array, state: _State, curved: Curvature, gradient: Array) -> Callable[[float], Array]:
    """mu -> -(beta J'J + (alpha + mu) I)^-1 gradient, gradient (p,) = beta J'e + alpha w, by the smaller system."""
    w, alpha, beta = state.weights, state.alpha, state.beta
    if not curved.dual:
        return lambda mu: -solve(factor(curved, beta, alpha + mu), gradient)
    along = layer.times_jacobian(w, x, w)

    def dual(mu: float) -> Array:
        shift = alpha + mu
        rows = solve(factor(curved, beta, shift), state.error - alpha / shift * along)
        return -beta * layer.times_transpose(w, x, rows) - alpha / shift * w

    return dual
