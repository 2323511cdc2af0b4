"""What a stress-strain record is itself uncertain about: its contact point, its load zero, the series behind its rate.

Each such number is written as a standard normal z_j with the change V_j of the stress that one standard deviation
makes, so that it can be solved for together with the moduli under its own prior. The contact point is found from the
noisy toe alone, the load zero from the samples before it, of which there may be one, its drift from rests before and
after the test or from other tests on the frame; the whole curve knows them better, and refines them here within their
priors.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from matcal.fitting.hyperfoam.curves import Curve, weighted_model, with_history
from matcal.fitting.hyperfoam.hyperfoam_fit import Fit
from matcal.fitting.relaxation.series import Series
from matcal.fitting.uncertainty import linear_response
from matcal.laws.prony import Prony
from matcal.reduction.experiment import Experiment
from touchcal.arrays import Array

# facts of an experiment: standard deviation of a correction -> how far refinement has moved that correction
FURTHER = "a slower term that the holds do not exclude"
_FARTHEST = 3.0  # standard deviations by which a correction moves at once: farther, its effect is no straight line
MOVED = {"strain_zero_sd": "strain_zero_moved", "zero_sd_Pa": "zero_moved_Pa",
         "drift_sd_N_per_s": "drift_moved_N_per_s"}


@dataclass(frozen=True)
class Nuisance:
    """Uncertain numbers z_j ~ N(mean_j, 1) of the record, and what they do."""

    effect: Array  # (n, K) change of the weighted stress with each z_j
    mean: Array  # (K,) prior means: minus what refinement has moved already
    names: tuple[str, ...]  # what each number is, in words
    series: Array | None  # (2 M, J) change of (g, tau_s) with the last J of them; None without a rate correction


def with_zero(experiment: Experiment, sd: float) -> Experiment:
    """The experiment with a standard deviation of its strain zero, where it states none and `sd` is one."""
    if sd == 0 or experiment.facts.get("strain_zero_sd", 0.0) > 0:
        return experiment
    return replace(experiment, facts={**experiment.facts, "strain_zero_sd": sd})


def without_load_zero(curve: Curve) -> Curve:
    """The curve with a load that is zero where a table's is; a load frame's keeps what its record says."""
    facts = curve.experiment.facts
    if not facts.get("strain_zero_assumed"):
        return curve
    kept = {name: value for name, value in facts.items() if name != "zero_sd_Pa"}
    return replace(curve, experiment=replace(curve.experiment, facts=kept))


def with_drift(experiments: Sequence[Experiment]) -> tuple[tuple[Experiment, ...], tuple[str, ...]]:
    """The experiments, those without a drift of their own given a standard deviation of it.

    A drift that no rest shows is taken as normal about 0. Its variance pools the squares of the drifts measured in the
    other tests, of which there are few, with one drift that adds up to the noise of the load over this test's duration:
    a scale learned from one or two drifts alone would often be far too small.
    """
    measured = [e.facts["drift_N_per_s"] for e in experiments if "drift_sd_N_per_s" in e.facts]
    out, said = [], []
    for experiment in experiments:
        if "area_mm2" not in experiment.facts or "drift_sd_N_per_s" in experiment.facts:
            out.append(experiment)
            continue
        names, typical = ", ".join(experiment.source), _typical_drift(experiment)
        known = measured if typical is None else [*measured, typical]
        if not known:
            said.append(f"Drift of the load zero is not known for {names}; the intervals leave it out.")
            out.append(experiment)
            continue
        sd = float(np.sqrt(np.mean(np.square(known))))
        said.append(f"Drift of the load zero could not be measured in {names}: 0 ± {sd * 1e3:.2g} mN/s is assumed, "
                    + _drift_reason(len(measured), typical) + ".")
        out.append(replace(experiment, facts={**experiment.facts, "drift_sd_N_per_s": sd, "drift_assumed": 1.0}))
    return tuple(out), tuple(said)


def _typical_drift(experiment: Experiment) -> float | None:
    """Drift that adds up to the noise of the load over the test, N/s; None without a clock or a known noise."""
    noise, time = experiment.facts.get("load_noise_N", 0.0), experiment.time_s
    return None if time is None or noise == 0 or time[-1] <= 0 else float(noise / time[-1])


def _drift_reason(measured: int, typical: float | None) -> str:
    if measured == 0:
        return "which adds up to the noise of its load over its duration"
    from_noise = f"{(typical or 0.0) * 1e3:.2g} mN/s, which adds up to the noise of its load over its duration"
    others = "the drift measured in the other tests"
    return f"the size of {others}" if typical is None else f"from {others} ({measured}) and {from_noise}"


def nuisance(fit: Fit, prony: Series | None = None) -> Nuisance:
    """Contact point, load zero and drift of every curve that states their standard deviation, then the series'
    directions."""
    found = [(_record_effect(fit, k, fact), _record_mean(fit.curves[k], fact)) for k, fact in _uncertain(fit)]
    directions = _principal_directions(prony) if prony is not None else []
    if prony is not None and prony.further is not None:
        found.append((_effect(fit, [with_history(c, prony.further) for c in fit.curves]), 0.0))
    effect = [v for v, _ in found] + [_prony_effect(fit, prony.prony, d) for d in directions if prony is not None]
    n = sum(c.experiment.value.size for c in fit.curves)
    return Nuisance(np.stack(effect, axis=1) if effect else np.zeros((n, 0)),
                    np.array([m for _, m in found] + [0.0] * len(directions)),
                    tuple(_name(fit.curves[k], fact) for k, fact in _uncertain(fit))
                    + (FURTHER,) * (len(found) - len(_uncertain(fit)))
                    + ("the Prony series, with contact and drift of its own test",) * len(directions),
                    np.stack(directions, axis=1) if directions else None)


def refined_records(fit: Fit) -> tuple[tuple[Curve, ...], float]:
    """The curves with zeros and drift where the whole curve wants them under their priors, to first order, and by how
    many of its standard deviations one was moved at most."""
    known = nuisance(fit)
    return settled_records(fit, linear_response.effective_variance(linear_response.errors_of(fit, known.effect)), known)


def settled_records(fit: Fit, variance: float, known: Nuisance | None = None) -> tuple[tuple[Curve, ...], float]:
    """`refined_records` where the variance of independent errors is known."""
    known = known or nuisance(fit)
    slopes, effect = linear_response.fitted_slopes(fit), linear_response.padded(fit, known.effect)
    gain = linear_response.joint_gain(slopes, effect, variance, linear_response.prior_precision(fit))
    miss = np.r_[-np.concatenate(linear_response.misses(fit)), np.sqrt(variance) * known.mean]
    step = gain[slopes.shape[1]:] @ miss
    most = float(np.max(np.abs(step), initial=0.0))
    curves = list(fit.curves)
    for (k, fact), z in zip(_uncertain(fit), step * _FARTHEST / max(most, _FARTHEST), strict=True):
        experiment = curves[k].experiment
        curves[k] = replace(curves[k], experiment=_moved(experiment, fact, float(z) * experiment.facts[fact]))
    return tuple(curves), most


def moved_sentences(curves: Sequence[Curve]) -> tuple[str, ...]:
    """What was moved, and by how much."""
    moved = [(c, fact, c.experiment.facts[MOVED[fact]]) for c in curves for fact in uncertain(c)
             if MOVED[fact] in c.experiment.facts]
    return tuple(f"{c.label}: {_size_words(fact, by)} ({by / c.experiment.facts[fact]:+.1f} of its standard deviation) "
                 "by the fit of the whole curve." for c, fact, by in moved)


def surprise(curves: Sequence[Curve]) -> float:
    """Sum of squares of how far corrections were moved, in their standard deviations: -2 ln of their prior."""
    return float(sum(_record_mean(c, fact) ** 2 for c in curves for fact in MOVED
                     if c.experiment.facts.get(fact, 0.0) > 0))


def _size_words(fact: str, by: float) -> str:
    if fact == "strain_zero_sd":
        return f"strain zero moved by {by:+.2g}"
    return f"load zero moved by {by:+.2g} Pa" if fact == "zero_sd_Pa" else \
        f"drift of the load zero moved by {by * 1e3:+.2g} mN/s"


def _name(curve: Curve, fact: str) -> str:
    if fact == "strain_zero_sd":
        of_table = curve.experiment.facts.get("strain_zero_assumed", 0.0) > 0
        return f"the {'zero of the strain' if of_table else 'contact point'} of {curve.label}"
    if fact == "zero_sd_Pa":
        return f"the load zero of {curve.label}"
    assumed = "drift_N_per_s" not in curve.experiment.facts or curve.experiment.facts.get("drift_assumed", 0.0) > 0
    return f"the {'assumed' if assumed else 'measured'} load drift of {curve.label}"


def _principal_directions(prony: Series) -> list[Array]:
    """One standard deviation of (g, tau_s) along each principal direction of their relative covariance."""
    size = np.r_[np.ones(prony.prony.g.size), prony.prony.tau_s]
    variance, axes = np.linalg.eigh(prony.covariance / np.outer(size, size))
    return [np.sqrt(v) * axis * size for v, axis in zip(variance, axes.T, strict=True) if v > 1e-12 * variance.max()]


def _uncertain(fit: Fit) -> list[tuple[int, str]]:
    return [(k, fact) for k, curve in enumerate(fit.curves) for fact in uncertain(curve)]


def uncertain(curve: Curve) -> list[str]:
    """Standard deviations, members of MOVED, that the curve's record states and that can be turned into stress."""
    return [fact for fact in MOVED if curve.experiment.facts.get(fact, 0.0) > 0 and _known(fact, curve.experiment)]


def _known(fact: str, experiment: Experiment) -> bool:
    """Whether the record has what turns a correction into stress."""
    return fact != "drift_sd_N_per_s" or ("area_mm2" in experiment.facts and experiment.time_s is not None)


def _record_effect(fit: Fit, k: int, fact: str) -> Array:
    """Change of the weighted stress expected in the record for one standard deviation of a correction of curve k."""
    curve = fit.curves[k]
    sd = curve.experiment.facts[fact]
    if fact == "strain_zero_sd":
        moved = replace(curve, experiment=_moved(curve.experiment, fact, sd))
        return _effect(fit, [*fit.curves[:k], moved, *fit.curves[k + 1:]])
    parts = [np.zeros(c.experiment.value.size) for c in fit.curves]
    parts[k] = (curve.experiment.value - _moved(curve.experiment, fact, sd).value) / curve.scale_Pa
    return np.concatenate(parts)


def _record_mean(curve: Curve, fact: str) -> float:
    return -curve.experiment.facts.get(MOVED[fact], 0.0) / curve.experiment.facts[fact]


def _moved(experiment: Experiment, fact: str, by: float) -> Experiment:
    """The experiment with its strain zero, or the zero or drift taken off its load, moved; the state of rest stays."""
    facts = {**experiment.facts, MOVED[fact]: experiment.facts.get(MOVED[fact], 0.0) + by}
    resting = experiment.strain == (1.0 if experiment.kind == "volumetric" else 0.0)
    if fact == "strain_zero_sd":
        strain = np.where(resting, experiment.strain, experiment.strain + by)
        return replace(experiment, strain=strain, facts=facts)
    if fact == "zero_sd_Pa":
        return replace(experiment, value=experiment.value - np.where(resting, 0.0, by), facts=facts)
    assert experiment.time_s is not None
    drift = by / (experiment.facts["area_mm2"] * 1e-6) * experiment.time_s
    return replace(experiment, value=experiment.value - drift, facts=facts)


def _prony_effect(fit: Fit, prony: Prony, direction: Array) -> Array:
    terms = prony.g.size
    share = 0.05 / max(1.0, float(np.max(np.abs(direction[terms:]) / prony.tau_s)))
    g = np.maximum(prony.g + share * direction[:terms], 0.0)
    moved = Prony(g, prony.tau_s + share * direction[terms:])
    return _effect(fit, [with_history(c, moved) for c in fit.curves]) / share


def _effect(fit: Fit, curves: Sequence[Curve]) -> Array:
    return weighted_model(curves, fit.law) - weighted_model(fit.curves, fit.law)
