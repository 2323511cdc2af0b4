"""Train a surrogate on a data set."""

from __future__ import annotations

import importlib.metadata
import os
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from surrogate.data import material_states, outputs
from surrogate.data.samples import PARTS, Samples, content_hash, split, take
from surrogate.data.sensor_ring import same_ring
from surrogate.model.model import Calibration, Model, Range, Rows, check_method, estimate

if TYPE_CHECKING:
    from surrogate.learners.bayesian_network.ensemble import Networks

# Methods whose training takes steps.
ITERATED = ("trainbr", "network", "mlp")
# Fewest rows of another set that calibrate intervals: as many as have an order statistic at 95 %.
MIN_CALIBRATING = 19
Progress = Callable[[Iterable[int]], Iterable[int]]


def train(samples: Samples, method: str, names: tuple[str, ...] = outputs.NAMES, seed: int = 0, *,
          epochs: int | None = None, workers: int = 1, each: Progress = iter,
          calibrate: Samples | None = None) -> Model:
    """Train `method` for the outputs of these names; of the touches 70 % train, 15 % calibrate, 15 % test,
    by the seed.

    `epochs` bounds the steps of those ITERATED; `workers` processes share the outputs of trainbr and network; `each`
    may show progress over them. Rows `calibrate`, as of another mesh, take the place of those 15 % when intervals are
    calibrated, so that these hold what that set shows of the model's error. ValueError for an unknown method, too few
    rows, another sensor, or data that the method cannot learn.
    """
    check_method(method)
    if epochs is not None and method not in ITERATED:
        raise ValueError(f"epochs are steps of {', '.join(ITERATED)}; {method} has none. Leave them out.")
    if epochs is not None and epochs < 1:
        raise ValueError(f"epochs must be 1 or more, got {epochs}.")
    part = split(samples.touch, seed)
    chosen = [outputs.NAMES.index(name) for name in names]
    training, validation = take(samples, part == "train"), take(samples, part == "val")
    _check_signals(training)
    if calibrate is not None:
        _check_calibrating(samples, calibrate)
        validation = calibrate
    begun = _cpu_s()
    learner, record = _learn(training, method, names, chosen, seed, epochs, workers, each)
    fit_s = _cpu_s() - begun
    target = training.target[:, chosen]
    span = Range(target.min(0), target.max(0), float(np.linalg.norm(training.signal_V, axis=1).min()), 0.0)
    model = Model(method, samples.ring, names, learner, Calibration(validation.signal_V, validation.target[:, chosen]),
                  _rows(samples, part, calibrate), span, samples.baseline_V.mean(0), seed, fit_s,
                  {**_provenance(samples, part, validation), "training": record})
    worst = float(estimate(model, validation.signal_V).misfit.max())
    return replace(model, trained=replace(span, misfit=worst))


def _cpu_s() -> float:
    """CPU time of this process and of its ended workers, s."""
    return sum(os.times()[:4])


def _check_calibrating(samples: Samples, calibrate: Samples) -> None:
    if not same_ring(samples.ring, calibrate.ring):
        raise ValueError("the calibrating set is of another sensor than the training set: its disc, electrodes or "
                         "drive differ. Sweep one of the same [body], [electrodes] and [drive].")
    if len(calibrate) < MIN_CALIBRATING:
        raise ValueError(f"{len(calibrate)} calibrating rows are too few for a 95 % interval; at least "
                         f"{MIN_CALIBRATING} are needed. Sweep more scenes.")
    if shared := int(np.sum(np.isin(calibrate.row_hash, samples.row_hash))):
        raise ValueError(f"{shared} of the calibrating rows are rows of the training set too. Give a set of other "
                         "touches, such as one on another mesh.")
    _check_signals(calibrate)


def _rows(samples: Samples, part: NDArray[np.str_], calibrate: Samples | None) -> Rows:
    """The rows that the model has seen; those that calibrate it instead of the validation rows count as such."""
    if calibrate is None:
        return Rows(samples.row_hash, _codes(part))
    used = np.full(len(calibrate), PARTS.index("val"))
    return Rows(np.concatenate([samples.row_hash, calibrate.row_hash]), np.concatenate([_codes(part), used]))


def _check_signals(samples: Samples) -> None:
    bad = ~(np.isfinite(samples.signal_V).all(axis=1) & np.isfinite(samples.target).all(axis=1))
    if np.any(bad):
        raise ValueError(f"scene {samples.scene[np.argmax(bad)]} holds a number that is not finite; a row that is ok "
                         "has numbers alone. Sweep that part again.")
    if silent := [int(s) for s, row in zip(samples.scene, samples.signal_V, strict=True) if not np.any(row)]:
        raise ValueError(f"scene {silent[0]} has no signal: every dv is 0. Mend the skin or the force of the sweep.")


def _learn(training: Samples, method: str, names: tuple[str, ...], chosen: list[int], seed: int, epochs: int | None,
           workers: int, each: Progress) -> tuple[Any, dict[str, Any]]:
    """The learner, and how its training went as JSON."""
    signal, target = training.signal_V, training.target[:, chosen]
    match method:
        case "trainbr":
            from surrogate.learners import trainbr
            from surrogate.learners.bayesian_network import bayesian_regularisation

            options = (
                bayesian_regularisation.Options() if epochs is None else bayesian_regularisation.Options(epochs=epochs)
            )
            found = trainbr.learn(signal, target, seed, options, workers, each)
            return found, _trainings(names, found.networks)
        case "network":
            from surrogate.learners import network

            options = network.ROBUST if epochs is None else replace(network.ROBUST, epochs=epochs)
            found = network.learn(signal, target, seed, options, workers, each)
            return found, _trainings(names, found.networks)
        case "forward":
            from surrogate.learners import forward

            states = material_states.states(material_states.learn(training.material), training.material)
            inversion = forward.learn(training.ring, signal, training.target, names, states)
            return inversion, {"modes": len(inversion.forward.field), "signal_floor": inversion.forward.floor,
                               "material_states": states.shape[1]}
        case "mlp":
            from surrogate.learners import mlp

            found = mlp.learn(signal, target, seed, epochs or mlp.STEPS)
            return found, {"components": len(found.directions.axes), "units": mlp.UNITS, "steps": epochs or mlp.STEPS}
        case "ridge":
            from surrogate.learners import ridge

            lines = ridge.learn(signal, target)
            return lines, dict(zip(names, lines.sizes, strict=True))
        case _:
            from surrogate.learners import gp

            found = gp.learn(signal, target)
            return found, {"components": len(found.directions.axes), "rows_kept": len(found.processes[0].nodes)}


def _trainings(names: tuple[str, ...], found: Networks) -> dict[str, Any]:
    keys = ("gamma", "alpha", "beta", "epochs", "stop", "log_evidence", "collapses", "collapsed")
    return {name: {key: getattr(training, key) for key in keys} | {"parameters": found.weights.shape[1]}
            for name, training in zip(names, found.trainings, strict=True)}


def _codes(part: NDArray[np.str_]) -> NDArray[np.int64]:
    return np.array([PARTS.index(p) for p in part], np.int64)


def _provenance(samples: Samples, part: NDArray[np.str_], validation: Samples) -> dict[str, Any]:
    names = ("touchcal", "numpy", "scipy", "torch")
    return {"dataset": {"sha256": content_hash(samples), "rows": len(samples), "measurement": dict(samples.measurement),
                        "cards": len(np.unique(samples.card)), "split": {p: int(np.sum(part == p)) for p in PARTS}},
            "calibration": {"sha256": content_hash(validation), "rows": len(validation),
                            "cards": len(np.unique(validation.card)),
                            "measurement": dict(validation.measurement)},
            "versions": {name: importlib.metadata.version(name) for name in names}}
