"""The law of a layer from force against depth of presses, with what else is not known of them.

Most probable unknowns by lmfit about a model that is solved anew until forces settle (`press_model`), then draws by
emcee about the last. A press's relative errors are white ones, at least the load cell's, and slow ones of what mesh,
profile and form of the law leave, correlated over depth as exp(-|ln d - ln d'|/LENGTH); how large both are the fit's
own residuals say, by the differences of neighbours and by all that is left.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import emcee
import lmfit
import numpy as np

from eitsim.presses.law_features import LawPrior, features, law_prior
from eitsim.presses.press_file import Press, check_presses
from eitsim.presses.press_model import EACH, NUISANCES, NearModel, PressSetup, near_model
from matcal.card import MaterialCard
from matcal.fitting.uncertainty.intervals import PLATEAU_STRAIN
from matcal.laws.law import Law, scaled, units
from matcal.posterior.derived_quantities import derived_of
from matcal.posterior.draws import Draws
from touchcal.arrays import Array
from touchcal.errors import NotConverged
from touchcal.jit import cpu_s

# Largest change of ln force between two models at which they have settled, that at which friction is sought, models at
# most, and parts of a step that are tried.
_SETTLED, _NEAR, _MODELS, _PARTS = 0.01, 0.1, 8, (1.0, 0.5, 0.25, 0.1)
_TRUSTED = 0.2  # noise over the residual of the model before while forces have not settled
_FLOOR, _CLEAR = 1e-3, 0.05  # noise of a reading, and the reading from which errors are judged, over the largest force
_SLOW, _LENGTH, _LEAST_M = 0.015, 2.0, 1e-4  # least slow error, its length in ln depth, and the depth it begins at
_WALKERS, _STEPS, _BURNT, _DRAWS = 60, 1400, 500, 1000
_TIMES, _STRIDE = 15.0, 4  # autocorrelation times that a chain needs, and steps of it that are looked at
# steps of differences by y, least precision of each, and least part of a spread at which walkers start
_SMALL, _LOOSE, _LEAST_SHARE = 1e-4, 1e-2, 1e-3
_OPEN, _SPAN = 0.8, 2.0  # posterior over prior standard deviation, and ratio of ends, from which a thing is open


@dataclass(frozen=True, eq=False)
class Identified:
    """What presses say of a layer."""

    law: Law  # the most probable
    draws: Draws  # of the law
    y: Array  # (D, size) draws of all unknowns, as in `press_model`
    model: NearModel
    noise: Array  # (presses, 2) relative errors of a reading, white and slow
    misfit: Array  # (presses,) r.m.s. of the relative residual
    derived: Mapping[str, Mapping[str, float]]  # quantity -> value, sd, lo, hi
    nuisances: Mapping[str, Mapping[str, float]]  # what is not the law's, units in the names
    not_determined: tuple[str, ...]
    converged: bool  # whether forces settled and the chain is long enough
    cpu_s: float


def identify(presses: Sequence[Press], setup: PressSetup, card: MaterialCard, *, seed: int = 0,
             progress: Callable[[str], None] = lambda said: None) -> Identified:
    """The law of a layer bonded to a rigid base from presses far from its edge.

    Parameters
    ----------
    presses
        As `read_presses` gives them; several punches tell more.
    setup
        Thickness, friction, contact point, load cell and machine, with how well they are known.
    card
        Which law is sought and from where; its draws, where it has some, are the prior.

    Raises
    ------
    ValueError
        For presses that do not fit the layer.
    NotConverged
        Where no law near the start carries the presses.

    Examples
    --------
    >>> import eitsim
    >>> import matcal
    >>> card = matcal.read_card("examples/foam_start.json")
    >>> presses = eitsim.read_presses("examples/press_flat.csv", eitsim.punch_of("flat 14"))
    >>> eitsim.identify(presses, eitsim.PressSetup(thickness_m=0.003), card)
    Traceback (most recent call last):
    ValueError: ...
    """
    started = cpu_s()
    check_presses(presses, setup.thickness_m)
    prior = law_prior(card)
    model, y, settled = _settled(setup, prior, presses, progress)
    residuals = _residuals(model, y)
    noise = _noise(setup, residuals, presses)
    y = _most_probable(model, y, noise)
    progress("drawing")
    chain, long_enough = _drawn(model, y, noise, seed)
    prior, p = model.prior, model.terms
    laws = _draws_of(prior, chain[:, :p])
    derived = {name: _summary(column) for name, column in derived_of(laws).items()}
    nuisances = {name: _summary(column) for name, column in _nuisances(model, chain).items()}
    return Identified(prior.laws(y[:p]), laws, chain, model, noise,
                      np.array([np.sqrt(np.mean(r**2)) for r in _residuals(model, y)]), derived, nuisances,
                      _not_determined(setup, presses, derived, nuisances), settled and long_enough, cpu_s() - started)


def _settled(setup: PressSetup, prior: LawPrior, presses: Sequence[Press], progress: Callable[[str], None]
             ) -> tuple[NearModel, Array, bool]:
    """The last model and the most probable unknowns by it, and whether forces settled."""
    p = len(prior.free)
    y = np.zeros(p + len(NUISANCES) + len(EACH) * len(presses))
    y[p + 1] = np.clip(0.25, *setup.friction)
    model = near_model(setup, prior, presses, y, None, whole=False)
    prior = _rescaled(prior, np.concatenate(_residuals(model, y)))
    model = near_model(setup, prior, presses, y, None, whole=False)
    whole = False
    for k in range(_MODELS):
        left = np.array([np.nanmedian(np.abs(r)) for r in _residuals(model, y)])
        noise = np.stack([np.maximum(setup.force_error, _TRUSTED * left), np.full(len(presses), _SLOW)], axis=-1)
        found = _most_probable(model, y, noise)
        change = _change(model, y, found)
        progress(f"model {k + 1}: forces changed by {change:.1%}")
        if whole and change < _SETTLED:
            return model, found, True
        whole = change < _NEAR or k > _MODELS // 2 or whole
        y, model = _stepped(setup, presses, model, y, found, whole=whole and len(model.near[0].friction) == 1)
    return model, y, False


def _rescaled(prior: LawPrior, residual: Array) -> LawPrior:
    """The prior about a start as stiff as the presses say, of the same stresses."""
    law = scaled(prior.law, float(np.exp(np.median(residual[np.isfinite(residual)]))))
    return replace(prior, law=law, size=units(law)[prior.free])


def _stepped(setup: PressSetup, presses: Sequence[Press], model: NearModel, y: Array, found: Array, *, whole: bool
             ) -> tuple[Array, NearModel]:
    """The unknowns found, or on the way to them the first that can be solved, and the model there."""
    for part in _PARTS:
        at = y + part * (found - y)
        try:
            return at, near_model(setup, model.prior, presses, at, model, whole=whole)
        except (NotConverged, ValueError):
            if part == _PARTS[-1]:
                raise
    raise AssertionError


def _residuals(model: NearModel, y: Array) -> list[Array]:
    """(n,) of each press: ln of read over modelled force, not finite where none is read."""
    with np.errstate(all="ignore"):
        return [np.log(one.press.force_N) - found[0]
                for one, found in zip(model.near, model.log_forces(y[None]), strict=True)]


def _change(model: NearModel, y: Array, found: Array) -> float:
    """Largest change of ln force where a tenth of the largest is reached."""
    return max(float(np.nanmax(np.abs(a - b)[:, one.press.force_N > 0.1 * one.press.force_N.max()])) for one, a, b in
               zip(model.near, model.log_forces(y[None]), model.log_forces(found[None]), strict=True))


def _noise(setup: PressSetup, residuals: Sequence[Array], presses: Sequence[Press]) -> Array:
    """(presses, 2) relative errors of readings, white and slow, by residuals (n,) of ln force."""
    out = []
    for residual, press in zip(residuals, presses, strict=True):
        r = residual[np.isfinite(residual) & (press.force_N > _CLEAR * press.force_N.max())]
        white = max(float(np.sqrt(np.mean(np.diff(r) ** 2) / 2)), setup.force_error / 2)
        out.append((white, max(float(np.sqrt(max(np.mean(r**2) - white**2, 0.0))), _SLOW)))
    return np.clip(out, 0.0, 0.3)


def relative_covariance(force_N: Array, depth_m: Array, noise: Array) -> Array:
    """(n, n) of errors over forces, of white and slow relative size (2,); readings near 0 have a floor."""
    relative = np.maximum(np.abs(force_N), _FLOOR * force_N.max()) / force_N.max()
    place = np.log(np.maximum(depth_m, _LEAST_M))
    slow = noise[1] ** 2 * np.exp(-np.abs(place[:, None] - place) / _LENGTH)
    return slow + np.diag(noise[0] ** 2 + (_FLOOR / relative) ** 2)


def _whitening(press: Press, noise: Array) -> Array:
    """(n, n) that makes errors of a press standard ones."""
    size = np.maximum(np.abs(press.force_N), _FLOOR * press.force_N.max())
    return np.linalg.inv(np.linalg.cholesky(relative_covariance(press.force_N, press.depth_m, noise))) / size


def _whitenings(model: NearModel, noise: Array) -> list[Array]:
    return [_whitening(one.press, each) for one, each in zip(model.near, noise, strict=True)]


def _standard(model: NearModel, y: Array, whiten: Sequence[Array]) -> list[Array]:
    """(D, n) residuals of each press as standard ones."""
    with np.errstate(over="ignore"):
        return [(one.press.force_N - np.exp(found)) @ by.T
                for one, found, by in zip(model.near, model.log_forces(y), whiten, strict=True)]


def _known(model: NearModel, y: Array) -> Array:
    """(D, ...) what is known before, as residuals in standard deviations; friction, thickness and contact are as
    likely anywhere within their bounds and are left out."""
    p, prior = model.terms, model.prior
    known = (features(prior.law, prior.vectors(y[:, :p])) - prior.mean) @ prior.root.T
    return np.hstack([known, y[:, :p] / prior.wide, y[:, p + 2:p + 4]])


def _inside(model: NearModel, y: Array) -> Array:
    """(D,) whether unknowns lie within their bounds."""
    p, (low, high) = model.terms, model.setup.friction
    return (model.prior.inside(y[:, :p]) & (np.abs(y[:, p]) <= 3**0.5) & (y[:, p + 1] >= low) & (y[:, p + 1] <= high)
            & (y[:, p + 2] >= 0) & np.all(np.abs(y[:, p + 4:]) <= 3**0.5, axis=1))


def _most_probable(model: NearModel, y: Array, noise: Array) -> Array:
    """(size,) by least squares from y."""
    p, (low, high), whiten = model.terms, model.setup.friction, _whitenings(model, noise)
    bound = {p: (-3**0.5, 3**0.5), p + 1: (low, high), p + 2: (0.0, 10.0)}
    bound |= {k: (-3**0.5, 3**0.5) for k in range(p + 4, len(y))}
    parameters = lmfit.Parameters()
    for k, value in enumerate(y):
        ends = bound.get(k, (-np.inf, np.inf))
        parameters.add(f"y_{k}", float(np.clip(value, ends[0] + 1e-6, ends[1] - 1e-6)), min=ends[0], max=ends[1])

    def left(given: lmfit.Parameters) -> Array:
        at = np.array([given[f"y_{k}"].value for k in range(len(y))])[None]
        found = np.hstack([*_standard(model, at, whiten), _known(model, at)])[0]
        return np.where(np.isfinite(found), np.clip(found, -1e6, 1e6), 1e6)

    found: Any = lmfit.minimize(left, parameters, method="least_squares", x_scale="jac", max_nfev=60)
    return np.array([found.params[f"y_{k}"].value for k in range(len(y))])


def _log_density(model: NearModel, y: Array, whiten: Sequence[Array]) -> Array:
    """(D,)."""
    out = np.full(len(y), -np.inf)
    inside = np.flatnonzero(_inside(model, y))
    if len(inside):
        left = np.hstack([*_standard(model, y[inside], whiten), _known(model, y[inside])])
        out[inside] = np.where(np.isfinite(left).all(axis=1), -0.5 * np.sum(left**2, axis=1), -np.inf)
    return out


def _drawn(model: NearModel, y: Array, noise: Array, seed: int) -> tuple[Array, bool]:
    """(_DRAWS, size) draws, and whether the chain is long enough for mu_0 and the plateau."""
    rng = np.random.default_rng(seed)
    whiten = _whitenings(model, noise)
    root, share, start = _root(model, y, whiten), 1.0, np.empty((0, y.size))
    while len(start) < _WALKERS:
        if share < _LEAST_SHARE:
            raise NotConverged("no draws were found near the most probable law.", estimate=y)
        trial = y + share * rng.normal(size=(10 * _WALKERS, y.size)) @ root.T
        start, share = np.vstack([start, trial[np.isfinite(_log_density(model, trial, whiten))]]), 0.8 * share
    sampler = emcee.EnsembleSampler(_WALKERS, y.size, lambda x: _log_density(model, x, whiten), vectorize=True,
                                    moves=[(emcee.moves.DEMove(), 0.7), (emcee.moves.DEMove(gamma0=1.0), 0.1),
                                           (emcee.moves.DESnookerMove(), 0.2)])
    sampler.random_state = np.random.RandomState(int(rng.integers(2**32))).get_state()
    sampler.run_mcmc(start[:_WALKERS], _STEPS, skip_initial_state_check=True)
    chain = np.asarray(sampler.get_chain(discard=_BURNT))
    found = derived_of(_draws_of(model.prior, chain[::_STRIDE].reshape(-1, y.size)[:, :model.terms]))
    times = [_STRIDE * float(emcee.autocorr.integrated_time(found[name].reshape(-1, _WALKERS, 1), tol=0)[0])
             for name in ("mu_0_Pa", "plateau_Pa")]
    flat = chain.reshape(-1, y.size)
    return flat[np.linspace(0, len(flat) - 1, _DRAWS).astype(int)], _TIMES * max(times) < _STEPS - _BURNT


def _root(model: NearModel, y: Array, whiten: Sequence[Array]) -> Array:
    """(size, size) root of the covariance at the most probable unknowns by least squares; what bounds alone know is of
    their size."""
    moved = y + _SMALL * np.vstack([np.eye(y.size), -np.eye(y.size)])
    left = np.hstack([*_standard(model, moved, whiten), _known(model, moved)])
    slope = (left[:y.size] - left[y.size:]) / (2 * _SMALL)
    root = np.linalg.cholesky(np.linalg.inv(slope @ slope.T + np.eye(y.size) * _LOOSE))
    return np.asarray(root, dtype=float)


def _draws_of(prior: LawPrior, white: Array) -> Draws:
    law = prior.law
    ends = np.cumsum([np.size(getattr(law, p.name)) for p in law.parameters])[:-1]
    parts = np.split(prior.vectors(white), ends, axis=1)
    return Draws({p.name: part for p, part in zip(law.parameters, parts, strict=True)}, type(law))


def _nuisances(model: NearModel, y: Array) -> dict[str, Array]:
    """Name -> (D,), in the unit of the name."""
    p, setup = model.terms, model.setup
    out = {"thickness_mm": 1e3 * setup.thickness_m * np.exp(setup.sd[0] * y[:, p]), "friction": y[:, p + 1],
           "compliance_mm_per_N": 1e3 * setup.sd[2] * y[:, p + 2], "load_cell_gain": np.exp(setup.sd[3] * y[:, p + 3])}
    return out | {f"contact_point_{k + 1}_mm": -1e3 * setup.each_sd[0] * y[:, p + 4 + k]
                  for k in range(len(model.near))}


def _summary(column: Array) -> dict[str, float]:
    low, middle, high = np.quantile(column, [0.025, 0.5, 0.975]).tolist()
    return {"value": middle, "median": middle, "sd": float(column.std()), "lo": low, "hi": high}


def _not_determined(setup: PressSetup, presses: Sequence[Press], derived: Mapping[str, Mapping[str, float]],
                    nuisances: Mapping[str, Mapping[str, float]]) -> tuple[str, ...]:
    """Quantities whose interval spans a factor of two, a plateau at more strain than the layer was pressed by, and
    nuisances of which the presses say little more than was known before."""
    known = {"thickness_mm": 1e3 * setup.thickness_m * setup.sd[0], "friction": setup.sd[1] / 12**0.5,
             "compliance_mm_per_N": 1e3 * setup.sd[2] * (1 - 2 / np.pi) ** 0.5, "load_cell_gain": setup.sd[3]}
    pressed = max(float(press.depth_m[-1]) for press in presses) / setup.thickness_m
    out = [name for name, row in derived.items() if row["lo"] <= 0 or row["hi"] > _SPAN * row["lo"]
           or (name == "plateau_Pa" and pressed < -PLATEAU_STRAIN)]
    return (*out, *(name for name, sd in known.items() if nuisances[name]["sd"] > _OPEN * sd))
