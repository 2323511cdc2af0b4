"""Rows of `surrogate frame`: one frame at a time."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from surrogate.data import outputs
from surrogate.data.baseline_frame import OTHER_BASELINE, relative_difference
from surrogate.data.flags import WORDS, Flag
from surrogate.data.frame_rows import Lines
from surrogate.forward_map.forward_map import ForwardMap
from surrogate.forward_map.inversion import mechanical_response
from surrogate.forward_map.inversion.invert import Inversion, invert
from surrogate.forward_map.load_coordinates import to_unknown
from surrogate.forward_map.scattering import scatters, unit_V
from surrogate.learners.forward import TouchInversion
from surrogate.model.missing_channels import named, silent
from surrogate.model.predict import WEAK, Predictions, Predictor, read_touches
from surrogate.model.sweep_model import SweepModel
from surrogate.model.trained import TrainedModel
from surrogate.single_frame.posterior import Posterior, posterior_of
from surrogate.single_frame.several_at_once import number, read_several
from surrogate.single_frame.simulated_posterior import simulated_posterior
from surrogate.single_frame.simulator_inversion import Direct, direct, relative_curvature
from surrogate.single_frame.simulator_likelihood import Simulator
from surrogate.statistics.conformal import COVERAGE, normal
from touchcal.arrays import Array, Mask
from touchcal.errors import NotConverged

Row = dict[str, Any]

D, F = 2, 3  # columns of the diameter and the force of a touch

UNEXPLAINED = 2.0  # misfit of a frame from which neither noise nor what is known of the simulator explains it
FEW = 100.0  # effective draws below which quantiles are rough
MISSED = 1.0  # standard deviations of the readings by which the corrected map may miss a scene
# Standard deviations of the readings by which they leave their tangent over an interval that is reported too narrow.
BENT = 1.0
BENT_WORDS = "readings bend along d and F, whose intervals may be too narrow: ask for --posterior"
SURE_MM = 0.05  # standard deviation of a diameter, mm, below which the learned map is sure of a known punch
# Standard deviation of F over the posterior, over that about its peak, from which a known punch has several branches of
# forces: two of equal weight lie nearly four of the latter from each other then.
BRANCHED = 2.0


@dataclass(frozen=True, eq=False)
class One:
    """One touched frame and what the learned map makes of it."""

    line: int
    signal_V: Array  # (readings,) touched minus untouched, V
    learned: Predictions


def learner_of(model: TrainedModel) -> TouchInversion:
    """The forward map of a model; ValueError for other methods."""
    if not isinstance(model.learner, TouchInversion):
        raise ValueError(f"this asks for a map from touches to readings, and the model is of method {model.method}. "
                         "Train one with `method` forward.")
    if model.learner.forward.materials:
        raise ValueError("the model was trained on several cards, whose readings the simulator of one card has not. "
                         "Train one on a sweep without [material] draws.")
    if missing := [name for name in outputs.TOUCHES if name not in model.names]:
        raise ValueError(f"the model does not tell {missing[0]}, and `direct` and `posterior` read x0, y0, d and F. "
                         "Train one with `outputs` all.")
    return model.learner


def whole(lines: Lines, model: TrainedModel) -> Lines:
    """Lines with a problem for each frame that lacks a channel, which these ways of reading do not leave out."""
    dead = silent(lines.volts, model.baseline_V)
    problem = [known or (f"{named(mask)}; --direct, --posterior and --touches need all" if mask.any() else "")
               for known, mask in zip(lines.problem, dead, strict=True)]
    return replace(lines, problem=problem)


def check_whole(dead: Mask) -> None:
    """ValueError for channels (readings,) that are dead in every frame."""
    if dead.any():
        raise ValueError(f"{named(dead)}, in every frame, and `direct`, `posterior` and `touches` 2 need all. Fix it, "
                         "or predict without them.")


def ones(predictor: Predictor, lines: Lines) -> Iterator[One]:
    """The frames in turn, those that lack a channel and lines that are no frame without values; ValueError where a
    channel is dead in all."""
    check_whole(predictor.dead)
    lines = whole(lines, predictor.model)
    for k, line in enumerate(lines.line.tolist()):
        alone = Lines(lines.line[k:k + 1], lines.volts[k:k + 1], lines.problem[k:k + 1])
        yield One(line, lines.volts[k] - predictor.baseline_V, read_touches(predictor, alone))


def check_baseline(simulated_V: Array, baseline_V: Array) -> None:
    """ValueError where an untouched frame is not the simulator's."""
    separation = relative_difference(baseline_V, simulated_V)
    if separation > OTHER_BASELINE:
        raise ValueError(f"the untouched frame differs by {separation:.0%} from the simulator's: card, scene and "
                         "frames are not of one sensor, drive and unit. Give the `card` and `data` or `scene` of these "
                         "frames.")


def direct_row(model: TrainedModel, simulator: Simulator, one: One, noise_V: float) -> Row:
    """Values and 90 % intervals of x0, y0, d and F, whose they are, and what they cost.

    The learned map's are kept where the simulator has no readings or does not explain the frame better, where noise
    leaves d and F, or the F of a known punch, on several branches, which one covariance cannot tell, and where they are
    closer.
    """
    learner = learner_of(model)
    names = outputs.TOUCHES
    if not np.isfinite(one.learned.value).any():
        return _direct_row(one, np.full(4, np.nan), np.full(4, np.nan), "none", None, one.learned.flag[0])
    found = invert(learner.forward, one.signal_V[None], noise_V)
    among_known = len(learner.forward.known_mm) > 0 and float(np.sqrt(found.covariance[0, 2, 2])) < SURE_MM
    sure = among_known or one_diameter(learner.forward)
    kept, half = (np.array([part[0, model.names.index(name)] for name in names])
                  for part in (one.learned.value, one.learned.half_width))
    flag = one.learned.flag[0]
    try:
        own = direct(simulator, learner.forward, one.signal_V, noise_V, found.touch[0], known_d=among_known)
    except NotConverged as error:
        return _direct_row(one, kept, half, "learned", None, _joined(flag, str(error)))
    why = _why_learned(own, _broad(found, sure), half / normal(COVERAGE), sure)
    if own.misfit > UNEXPLAINED:
        flag = _joined(flag, "the simulator does not explain this frame")
    if why:
        shared = np.sqrt(np.maximum(np.diag(own.covariance) - np.diag(own.own) * max(own.misfit, 1.0), 0.0))
        return _direct_row(one, kept, np.hypot(half, shared * normal(COVERAGE)), "learned", own, _joined(flag, why))
    if not sure and relative_curvature(learner.forward, own.touch, own.covariance, own.unknowns.whitening) > BENT:
        flag = _joined(flag, BENT_WORDS)
    return _direct_row(one, own.touch, np.sqrt(np.diag(own.covariance)) * normal(COVERAGE), "simulator", own, flag)


def one_diameter(forward: ForwardMap) -> bool:
    """Whether all training touches are of one diameter, so that a map knows that of any touch."""
    (_, least, _), (_, largest, _) = forward.bounds
    return bool(least == largest)


def _broad(found: Inversion, sure: bool) -> str:
    """What of the first touch one covariance does not tell; empty where it tells all. sure: of its diameter."""
    if not found.broad[0]:
        return ""
    if not sure:
        return "d and F are broad: ask for --posterior"
    peak = found.peak.joint[0]
    about_peak = peak[F, F] - peak[D, F] ** 2 / peak[D, D]
    return "several forces fit this frame" if found.covariance[0, F, F] > BRANCHED**2 * about_peak else ""


def _why_learned(own: Direct, broad: str, learned_sd: Array, sure: bool) -> str:
    """Why the learned map's answer is kept; empty where it is not. sure: of the diameter, which is not compared."""
    if broad:
        return broad
    if not own.converged:
        return "the simulator's search ended short"
    sd = np.sqrt(np.diag(own.own)) * np.sqrt(max(own.misfit, 1.0))
    if np.sum(np.log(sd / np.maximum(learned_sd, 1e-9)), where=~(sure & (np.arange(4) == D))) > 0:
        return "the learned map tells this touch closer"
    return ""


def several_row(model: SweepModel, line: int, signal_V: Array, noise_V: float, most: int) -> Row:
    """The touches of a signal (readings,), V, at most so many, in the order of x, with standard deviations."""
    forward = learner_of(model).forward
    if np.linalg.norm(signal_V) < WEAK * model.trained.weakest_V:
        return {"line": line, "touches": 0, "flag": WORDS[Flag.NO_TOUCH]}
    one_V = unit_V(forward.ring, model.baseline_V) if scatters(forward.ring) else None
    alone = invert(forward, signal_V[None], noise_V).touch
    each = read_several(forward, signal_V, noise_V, to_unknown(alone, forward.p0)[0], most, one_V)
    count = number(each)
    found = each[count - 1]
    row: Row = {"line": line, "touches": count}
    for k, (touch, sd) in enumerate(zip(found.touch, np.sqrt(np.diag(found.covariance)).reshape(-1, 4), strict=True)):
        for name, value, spread in zip(outputs.NAMES, touch, sd, strict=False):
            unit = outputs.of(name).unit
            row |= {f"{name}_{k + 1}_{unit}": value, f"{name}_{k + 1}_sd_{unit}": spread}
    flag = _joined("the touches are too near each other to be distinguished" if found.too_near else "",
                   WORDS[Flag.MISFIT] if found.misfit > UNEXPLAINED else "")
    return row | {"misfit": found.misfit, "misfit_of_one": each[0].misfit, "flag": flag}


def _direct_row(one: One, value: Array, half: Array, taken: str, own: Direct | None, flag: str) -> Row:
    row: Row = {"line": one.line}
    for name, v, h in zip(outputs.TOUCHES, value, half, strict=True):
        unit = outputs.of(name).unit
        row |= {f"{name}_{unit}": v, f"{name}_lo90_{unit}": v - h, f"{name}_hi90_{unit}": v + h}
    cost = {"misfit": np.nan, "residual_V": np.nan, "left_out_error": np.nan, "simulations": 0, "cpu_s": np.nan}
    if own is not None:
        cost = {"misfit": own.misfit, "residual_V": float(np.sqrt(np.mean(own.residual_V**2))),
                "left_out_error": own.error_estimate, "simulations": own.simulations, "cpu_s": own.cpu_s}
    return row | {"by": taken} | cost | {"flag": flag}


def posterior_row(model: TrainedModel, simulator: Simulator | None, one: One, noise_V: float, seed: int) -> Row:
    """Median, standard deviation, 5 and 95 % of every output of the model, correlation of d and F, and how good the
    chains are; without numbers where the frame has no touch or no posterior. Where there is a simulator, by its
    likelihood."""
    learner = learner_of(model)
    if not np.isfinite(one.learned.value).any():
        return {"line": one.line, "flag": one.learned.flag[0]}
    try:
        found, why, by = _posterior(learner, simulator, one, noise_V, seed)
    except NotConverged as error:
        return {"line": one.line, "flag": _joined(one.learned.flag[0], str(error))}
    row: Row = {"line": one.line}
    for name, values in _values(model, learner, found, seed).items():
        unit, (low, middle, high) = outputs.of(name).unit, np.quantile(values, (0.05, 0.5, 0.95))
        row |= {f"{name}_median_{unit}": middle, f"{name}_sd_{unit}": values.std(), f"{name}_q05_{unit}": low,
                f"{name}_q95_{unit}": high}
    row |= {"correlation_d_F": float(np.asarray(np.corrcoef(found.draws[:, 2:].T))[0, 1]),
            "misfit": found.misfit, "effective_draws": found.effective}
    row |= {key: found.checks[key] for key in ("rhat", "ess", "autocorrelation_steps", "steps", "acceptance")} | by
    flags = [one.learned.flag[0], why, "" if found.checks["converged"] else "the chains did not converge",
             "few draws count" if found.effective < FEW else "",
             WORDS[Flag.MISFIT] if found.misfit > UNEXPLAINED else ""]
    return row | {"cpu_s": found.cpu_s, "flag": _joined(*flags)}


def _posterior(learner: TouchInversion, simulator: Simulator | None, one: One, noise_V: float,
               seed: int) -> tuple[Posterior, str, Row]:
    """The posterior, what is to be known of it, and whose it is."""
    if simulator is None:
        return posterior_of(learner.forward, one.signal_V, noise_V, seed), "", {"by": "learned"}
    try:
        found = simulated_posterior(simulator, learner.forward, one.signal_V, noise_V, seed)
    except NotConverged as error:
        own = posterior_of(learner.forward, one.signal_V, noise_V, seed)
        return own, str(error), {"by": "learned", "simulations": 0, "held_out_error": np.nan}
    why = "the corrected map misses scenes by more than the noise" if found.held_out_error > MISSED else ""
    return found.posterior, why, {"by": "simulator", "simulations": found.simulations,
                                  "held_out_error": found.held_out_error}


def _values(model: TrainedModel, learner: TouchInversion, found: Posterior, seed: int) -> dict[str, Array]:
    """Draws of every output of the model: the touch, and its learned response with that one's own scatter."""
    values = dict(zip(outputs.NAMES, found.draws.T, strict=False))
    mechanical = [name for name in model.names if name in outputs.RESPONSES]
    if mechanical:
        answer = mechanical_response.respond(learner.response, learner.forward.ring, found.draws,
                                             np.zeros((len(found.draws), 0)))
        scatter = np.random.default_rng([seed, 7]).normal(size=answer.sd.shape)
        values |= dict(zip(mechanical, (answer.value + answer.sd * scatter).T, strict=True))
    return {name: values[name] for name in model.names}


def _joined(*flags: str) -> str:
    return "; ".join(dict.fromkeys(flag for flag in flags if flag))
